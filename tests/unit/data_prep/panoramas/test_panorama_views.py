"""Pinhole views of panoramas."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.data_prep.panoramas.view import PanoramaView, panorama_view
from diff4splat.geometry.lenses.equirectangular import Equirectangular

SIDES = (64, 128)


def directions_of_a_panorama() -> np.ndarray:
    """A panorama whose colours are its directions, as (1 + direction) / 2."""
    rows, columns = (np.arange(side) + 0.5 for side in SIDES)
    latitude = (rows / SIDES[0] - 0.5) * math.pi
    longitude = (columns / SIDES[1] - 0.5) * 2 * math.pi
    points = np.stack(np.meshgrid(longitude, latitude), -1)
    found, _ = Equirectangular().directions(torch.from_numpy(points))
    return ((1 + found.numpy()) / 2).astype(np.float32)


def seen(view: PanoramaView) -> np.ndarray:
    direction = 2 * panorama_view(directions_of_a_panorama(), view) - 1
    return direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@settings(max_examples=20, deadline=None)
@given(yaw=st.floats(-180, 180), pitch=st.floats(-60, 60), roll=st.floats(-40, 40))
def test_the_middle_looks_where_yaw_and_pitch_say(yaw: float, pitch: float, roll: float) -> None:
    view = PanoramaView(size_px=(33, 33), fov_deg=50.0, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    y, p = math.radians(yaw), math.radians(pitch)
    wanted = [math.sin(y) * math.cos(p), -math.sin(p), math.cos(y) * math.cos(p)]
    np.testing.assert_allclose(seen(view)[16, 16], wanted, atol=0.03)


def test_straight_lines_stay_straight_and_the_width_has_the_field_of_view() -> None:
    view = PanoramaView(size_px=(31, 61), fov_deg=70.0)
    direction = seen(view)
    slope = direction[..., 0] / direction[..., 2]
    half = math.tan(math.radians(35))
    np.testing.assert_allclose(slope[15], (np.arange(61) - 30) / 30.5 * half, atol=0.02)
    np.testing.assert_allclose(slope, slope[15:16].repeat(31, 0), atol=0.02)


def test_roll_turns_the_image_around_its_middle() -> None:
    level = seen(PanoramaView(size_px=(41, 41), fov_deg=40.0))
    turned = seen(PanoramaView(size_px=(41, 41), fov_deg=40.0, roll_deg=90.0))
    np.testing.assert_allclose(turned, np.rot90(level), atol=0.02)


def test_the_seam_does_not_show() -> None:
    ahead = PanoramaView(size_px=(32, 32), fov_deg=60.0)
    behind = PanoramaView(size_px=(32, 32), fov_deg=60.0, yaw_deg=180.0)
    np.testing.assert_allclose(seen(behind), seen(ahead) * np.array([-1, 1, -1]), atol=0.02)


@pytest.mark.parametrize("pitch", [-90.0, 90.0])
def test_a_pole_has_finite_pixels(pitch: float) -> None:
    view = PanoramaView(size_px=(16, 16), fov_deg=100.0, pitch_deg=pitch)
    assert np.isfinite(seen(view)).all()

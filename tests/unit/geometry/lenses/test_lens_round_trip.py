"""Pixels to directions and back, for every lens."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from lens_cases import NAMES, lens_case, pixel_grid

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import stack_cameras
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.geometry.lenses.sensor import sensor_directions, sensor_pixels

coefficient = st.floats(-0.05, 0.05)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    # float32 pixels are 3e-5 apart at 480; a few roundings of directions add up.
    ("dtype", "tolerance_px"),
    [(torch.float64, 1e-9), (torch.float32, 5e-4)],
)
def test_every_pixel_returns_to_itself(name: str, dtype: torch.dtype, tolerance_px: float) -> None:
    camera, lens = lens_case(name)
    camera, lens, pixels = camera.to(dtype), lens.to(dtype), pixel_grid().to(dtype)
    directions, seen = sensor_directions(camera, lens, pixels)
    back, exists = sensor_pixels(camera, lens, directions)
    assert directions.dtype == back.dtype == dtype
    assert exists[seen].all(), "a pixel with a direction lost its way back"
    assert seen.double().mean() > 0.7
    torch.testing.assert_close(back[seen], pixels[seen], atol=tolerance_px, rtol=0)
    norms = torch.linalg.vector_norm(directions, dim=-1)
    torch.testing.assert_close(norms, torch.ones_like(norms))


@pytest.mark.parametrize("name", ["fisheye", "blender"])
def test_wide_lenses_look_behind_themselves(name: str) -> None:
    camera, lens = lens_case(name)
    directions, seen = sensor_directions(camera, lens, pixel_grid())
    assert directions[seen][:, 2].min() < math.cos(math.radians(110))


@pytest.mark.parametrize("name", NAMES)
def test_the_length_of_directions_does_not_matter(name: str) -> None:
    _, lens = lens_case(name)
    directions = torch.randn(200, 3, dtype=torch.float64)
    points, exists = lens.points(directions)
    for scale in (1e-25, 3.0, 1e25):
        scaled, still = lens.points(directions * scale)
        assert torch.equal(still, exists)
        torch.testing.assert_close(scaled, points, atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_every_lens_is_a_lens_and_casts(name: str) -> None:
    _, lens = lens_case(name)
    assert isinstance(lens, Lens)
    assert isinstance(lens.to(torch.float32), type(lens))


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(coefficient, coefficient, coefficient, coefficient),
    st.floats(0.0, math.pi),
    st.floats(-math.pi, math.pi),
)
def test_fisheye_points_return_to_their_direction(
    k: tuple[float, ...], angle: float, azimuth: float
) -> None:
    lens = OpenCVFisheye(coefficients=torch.tensor(k, dtype=torch.float64))
    ring = math.sin(angle)
    direction = torch.tensor(
        [ring * math.cos(azimuth), ring * math.sin(azimuth), math.cos(angle)], dtype=torch.float64
    )
    points, exists = lens.points(direction)
    back, seen = lens.directions(points)
    if angle < lens.largest_angle_rad - 1e-3:
        assert exists
    if angle > lens.largest_angle_rad + 1e-3:
        assert not exists
    if exists:
        assert seen
        torch.testing.assert_close(back, direction, atol=1e-7, rtol=0)


def test_a_batch_of_cameras_is_refused(as_shipped: None) -> None:
    camera, lens = lens_case("fisheye")
    batch = stack_cameras([camera, camera])
    with pytest.raises(ShapeError, match="index it first"):
        sensor_directions(batch, lens, pixel_grid((2, 2)))
    with pytest.raises(ShapeError, match="index it first"):
        sensor_pixels(batch, lens, torch.ones(3, dtype=torch.float64))

"""A long exposure: variance grows by v² e² / 12, along the motion alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, drifting, row_centers, shot, spot

from diff4splat.geometry.optics import Optics, Shutter
from diff4splat.render.trace.settings import TraceSettings

FAINT = replace(SHARP, trace=TraceSettings(alpha_cutoff=1e-6))
FOCAL, DEPTH, EXPOSURE = 100.0, 4.0, 0.02


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0])
def test_the_second_moment_grows_by_a_twelfth(angle_deg: float) -> None:
    x, y = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    path_px = 10.0
    speed = path_px / EXPOSURE * DEPTH / FOCAL
    scene = drifting(dots([(0, 0, DEPTH)], 0.06), (speed * x, speed * y, 0.0))
    settings = replace(FAINT, samples=128)
    made = shot(scene, camera_of((41, 45)), Optics(exposure_s=EXPOSURE), settings)
    found = spot(made.alpha)
    own = (FOCAL * 0.06 / DEPTH) ** 2
    want = own * np.eye(2) + path_px**2 / 12 * np.outer([x, y], [x, y])
    np.testing.assert_allclose(found.covariance, want, atol=0.01 * want.max())
    np.testing.assert_allclose(found.center, [22.5, 20.5], atol=0.03)
    assert found.mass == pytest.approx(0.9 * 2 * math.pi * own, rel=0.01)


def test_a_frame_that_starts_at_its_time_sees_what_comes_after() -> None:
    scene = drifting(dots([(0, 0, DEPTH)], 0.06), (20.0, 0.0, 0.0))
    optics = Optics(exposure_s=EXPOSURE, timestamp="start")
    found = spot(shot(scene, camera_of((33, 55)), optics, FAINT).alpha)
    path_px = 20.0 * FOCAL / DEPTH * EXPOSURE
    assert found.center[0] == pytest.approx(27.5 + path_px / 2, abs=0.05)


def test_with_a_rolling_shutter_every_row_is_exposed_around_its_own_time() -> None:
    speed, readout = 16.0, 0.03
    px_per_s = speed * FOCAL / DEPTH
    one = dots([(0, 0, DEPTH)], 0.06)
    edge = replace(one, scales=torch.tensor([[0.06, 1e3, 0.06]]))
    optics = Optics(shutter=Shutter(readout_s=readout), exposure_s=EXPOSURE)
    settings = replace(FAINT, samples=128)
    made = shot(drifting(edge, (speed, 0, 0)), camera_of((21, 55)), optics, settings).alpha
    shares = np.arange(21) / 20 - 0.5
    np.testing.assert_allclose(row_centers(made), 27.5 + px_per_s * readout * shares, atol=0.06)
    columns = np.arange(55) + 0.5
    weights = made.double().numpy()
    away = columns - row_centers(made)[:, None]
    variances = (weights * away**2).sum(1) / weights.sum(1)
    want = 1.5**2 + (px_per_s * EXPOSURE) ** 2 / 12
    np.testing.assert_allclose(variances, want, rtol=0.03)


def test_sixteen_samples_are_taken_unless_told_otherwise() -> None:
    scene, camera = drifting(dots([(0, 0, DEPTH)]), (1.0, 0, 0)), camera_of((5, 5))
    assert shot(scene, camera, Optics(exposure_s=EXPOSURE)).samples == 16
    settings = replace(SHARP, samples=3)
    assert shot(scene, camera, Optics(exposure_s=EXPOSURE), settings).samples == 3


def test_a_pulse_that_is_over_meanwhile_is_seen_for_its_share_of_the_exposure() -> None:
    # Opacity o exp(-t² / 2 d²), dark beyond the gate; at the mean's own pixel.
    deviation, exposure = 0.004, 0.1
    scene = drifting(dots([(0, 0, DEPTH)], 0.5, opacity=0.6), (0, 0, 0), deviation_s=deviation)
    settings = replace(SHARP, samples=1024)
    made = shot(scene, camera_of((1, 1)), Optics(exposure_s=exposure), settings).alpha
    reach = math.sqrt(-2 * math.log(0.05))
    seen = deviation * math.sqrt(2 * math.pi) * math.erf(reach / math.sqrt(2))
    assert float(made[0, 0]) == pytest.approx(0.6 * seen / exposure, rel=0.01)

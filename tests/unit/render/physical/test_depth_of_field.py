"""A thin lens on one small Gaussian: a uniform disc of radius f_x A |1/f - 1/z| pixels.

The mass of a Gaussian's image is 2π σ² o and its variance per axis σ²; a uniform disc adds a
quarter of its squared radius.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, shot, spot

from diff4splat.geometry.optics import Aperture, Optics
from diff4splat.render.trace.settings import TraceSettings

FAINT = replace(SHARP, trace=TraceSettings(alpha_cutoff=1e-6))
FOCAL, DEPTH, SIGMA = 100.0, 4.0, 0.04


def lens(radius: float, focus: float, surface: str = "plane") -> Optics:
    return Optics(aperture=Aperture(radius=radius, focus_distance=focus, surface=surface))


@pytest.mark.parametrize(("radius", "focus"), [(0.5, 8.0), (0.3, 2.0), (0.4, 100.0)])
def test_a_point_out_of_focus_is_a_disc(radius: float, focus: float) -> None:
    made = shot(
        dots([(0, 0, DEPTH)], SIGMA), camera_of((41, 45)), lens(radius, focus),
        replace(FAINT, samples=256), outputs=("alpha",),
    )  # fmt: skip
    disc = FOCAL * radius * abs(1 / focus - 1 / DEPTH)
    own = (FOCAL * SIGMA / DEPTH) ** 2
    found = spot(made.alpha)
    assert found.mass == pytest.approx(0.9 * 2 * math.pi * own, rel=0.02)
    np.testing.assert_allclose(found.center, [22.5, 20.5], atol=0.03)
    want = (disc**2 / 4 + own) * np.eye(2)
    np.testing.assert_allclose(found.covariance, want, atol=0.02 * want[0, 0])


def test_the_disc_is_uniform_and_ends_at_its_radius() -> None:
    disc = FOCAL * 0.8 * abs(1 / 8 - 1 / DEPTH)
    made = shot(
        dots([(0, 0, DEPTH)], SIGMA), camera_of((41, 41)), lens(0.8, 8.0),
        replace(FAINT, samples=512), outputs=("alpha",),
    ).alpha  # fmt: skip
    rows, columns = np.indices(made.shape) - 20
    away = torch.from_numpy(np.hypot(rows, columns))
    inside, outside = made[away < disc - 4], made[away > disc + 5]
    # All of the Gaussian, whose variance is one square pixel, is spread over the disc.
    want = 0.9 * 2 * math.pi / (math.pi * disc**2)
    torch.testing.assert_close(inside, torch.full_like(inside, want), rtol=0.12, atol=0)
    assert float(inside.mean()) == pytest.approx(want, rel=0.01)
    assert float(outside.max()) < 1e-4


@pytest.mark.parametrize("surface", ["plane", "sphere"])
def test_what_is_in_focus_off_the_axis_lies_on_a_plane_or_a_sphere(surface: str) -> None:
    tangent, focus, radius = 0.75, 5.0, 0.4
    cosine = 1 / math.hypot(1, tangent)
    camera = camera_of((31, 31))
    camera = replace(camera, center_px=torch.tensor([15.5 - FOCAL * tangent, 15.5]))
    for depth in (focus, focus * cosine):
        in_focus = focus if surface == "plane" else focus * cosine
        disc = FOCAL * radius * abs(1 / depth - 1 / in_focus)
        dot = dots([(tangent * depth, 0, depth)], 0.01 * depth)
        blurred, sharp = (
            spot(shot(dot, camera, optics, replace(FAINT, samples=256), outputs=("alpha",),
                      backend="trace").alpha)
            for optics in (lens(radius, focus, surface), None)
        )  # fmt: skip
        # Only downwards is the ray at a right angle to the lens's radius; sideways z_p varies.
        grown = blurred.covariance[1, 1] - sharp.covariance[1, 1]
        assert grown == pytest.approx(disc**2 / 4, rel=0.04, abs=0.02)


def test_a_closed_aperture_is_a_pinhole_with_one_ray_per_pixel() -> None:
    cloud, camera = dots([(0, 0, 4), (0.3, 0.2, 3)], 0.1), camera_of()
    closed = shot(cloud, camera, lens(0.0, 2.0), replace(SHARP, samples=64), backend="trace")
    without = shot(cloud, camera, backend="trace")
    assert torch.equal(closed.rgb, without.rgb)
    assert torch.equal(closed.alpha, without.alpha)
    assert closed.samples == 1
    assert "aperture: its radius is 0" in closed.skipped_effects
    assert any("64 samples" in words for words in closed.skipped_effects)


def test_what_is_in_focus_stays_as_sharp_as_without_a_lens() -> None:
    # Responses peak on the plane of the mean, where all rays of a pixel meet.
    cloud, camera = dots([(0.1, -0.05, 4)], 0.03), camera_of()
    blurred = shot(cloud, camera, lens(0.1, 4.0), FAINT)
    sharp = shot(cloud, camera, None, FAINT, backend="trace")
    assert float(sharp.alpha.max()) > 0.6
    torch.testing.assert_close(blurred.alpha, sharp.alpha, rtol=0, atol=2e-3)
    assert blurred.samples == 64


def test_more_samples_help_more_than_chance_would() -> None:
    cloud, camera = dots([(0, 0, 4)], 0.2), camera_of((15, 15))
    images = {
        count: shot(cloud, camera, lens(0.8, 8.0), replace(FAINT, samples=count)).alpha
        for count in (8, 128, 2048)
    }
    errors = [float((images[n] - images[2048]).square().mean().sqrt()) for n in (8, 128)]
    order = math.log(errors[0] / errors[1]) / math.log(128 / 8)
    assert order > 0.7


def test_samples_of_two_seeds_differ_and_of_one_do_not() -> None:
    cloud, camera = dots([(0, 0, 4)], 0.1), camera_of((9, 9))
    first, again = (shot(cloud, camera, lens(0.5, 8.0)).rgb for _ in range(2))
    other = shot(cloud, camera, lens(0.5, 8.0), replace(SHARP, seed=1)).rgb
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
    torch.testing.assert_close(first, other, rtol=0, atol=0.1)


def test_depth_is_of_what_is_there_and_not_of_the_blur() -> None:
    cloud, camera = dots([(0, 0, 4)], 0.02), camera_of()
    made = shot(cloud, camera, lens(0.5, 8.0), outputs=("alpha", "depth", "distance"))
    assert int((made.alpha > 0.01).sum()) > 4 * int((made.depth > 0).sum()) > 0
    torch.testing.assert_close(
        made.depth[made.depth > 0], torch.full_like(made.depth[made.depth > 0], 4.0),
        rtol=1e-3, atol=0,
    )  # fmt: skip

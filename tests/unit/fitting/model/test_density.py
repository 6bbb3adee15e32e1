"""Gaussians are split where the image gradients, and faint ones go."""

import math
from dataclasses import replace

import torch
from small_fits import ball_capture

from diff4splat.fitting.model.canonical import activate, params_from_points
from diff4splat.fitting.model.density import densify_and_prune, split
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.objective.gradient_statistics import (
    GradientStatistics,
    pinhole_ndc_scale,
)
from diff4splat.fitting.settings import DensitySettings
from diff4splat.scene.gaussians import Gaussians

DENSITY = DensitySettings(budget=100, growth=0.5, min_gradient=1e-6)


def model(count: int = 10, pulses: bool = False) -> SceneModel:
    capture = ball_capture(views=2, times=2, held=())
    points = replace(
        capture.points,
        positions=capture.points.positions[:count],
        rgb=capture.points.rgb[:count],
    )
    motion = SpacetimeGaussians((0.0, 1.0), 0.05) if pulses else NoMotion((0.0, 1.0))
    return SceneModel(params_from_points(points, 1), motion, torch.full((count,), pulses))


def covariance(gaussians: Gaussians) -> torch.Tensor:
    """Mean of outer products of the mixture about its own mean, from means and rotations."""
    from diff4splat.geometry import quaternion

    turned = quaternion.to_matrix(gaussians.quats.double()) * gaussians.scales.double()[:, None]
    inner = (turned @ turned.mT).mean(0)
    apart = gaussians.means.double() - gaussians.means.double().mean(0)
    return inner + (apart[:, :, None] * apart[:, None]).mean(0)


def test_a_split_keeps_mean_and_covariance():
    made = model(1)
    with torch.no_grad():
        made.table["log_scales"].copy_(torch.tensor([[0.1, 0.7, 0.3]]).log())
        made.table["quats"].copy_(torch.tensor([[0.3, -0.2, 0.8, 0.1]]))
    before = activate(made.table, 1)
    mean, spread = before.means.detach().clone(), covariance(before).detach()
    split(made, torch.tensor([0]), torch.Generator().manual_seed(0))
    after = activate(made.table, 1)
    assert len(after) == 2
    torch.testing.assert_close(after.means.detach().mean(0), mean[0])
    torch.testing.assert_close(covariance(after).detach(), spread, rtol=1e-5, atol=1e-7)


def test_a_split_in_time_keeps_the_moments_of_time_and_the_line_of_motion():
    motion = SpacetimeGaussians((0.0, 1.0), 0.01)
    rows = {
        "means": torch.tensor([[0.0, 1.0, 2.0]]),
        "velocities": torch.tensor([[1.0, -2.0, 0.5]]),
        "time_centers_s": torch.tensor([0.4]),
        "log_deviations": torch.tensor([0.2]).log(),
    }
    early, late = motion.split_in_time(rows, torch.tensor([True]), torch.Generator())
    deviation = [float(half["log_deviations"].exp()) for half in (early, late)]
    centers = [float(half["time_centers_s"]) for half in (early, late)]
    assert math.isclose(sum(centers) / 2, 0.4, rel_tol=1e-6)
    variance = sum(d**2 + (c - 0.4) ** 2 for d, c in zip(deviation, centers, strict=True)) / 2
    assert math.isclose(variance, 0.04, rel_tol=1e-5)
    for half in (early, late):
        elapsed = half["time_centers_s"] - rows["time_centers_s"]
        expected = rows["means"] + elapsed[:, None] * rows["velocities"]
        torch.testing.assert_close(half["means"], expected)


def test_those_pulled_most_are_split_and_the_budget_holds():
    made = model(10)
    gradient = torch.zeros(10)
    gradient[3], gradient[7] = 1.0, 0.5
    dropped, count = densify_and_prune(made, gradient, DENSITY, torch.Generator())
    assert (dropped, count, len(made)) == (0, 2, 12)
    for _ in range(8):
        densify_and_prune(
            made, torch.ones(len(made)), replace(DENSITY, budget=20), torch.Generator()
        )
    assert len(made) == 20


def test_faint_and_broken_gaussians_are_dropped_but_never_all():
    made = model(10)
    with torch.no_grad():
        made.table["opacity_logits"][:9] = -9.0
    dropped, _ = densify_and_prune(made, torch.zeros(10), DENSITY, torch.Generator())
    assert (dropped, len(made)) == (9, 1)
    with torch.no_grad():
        made.table["opacity_logits"][:] = -9.0
    assert densify_and_prune(made, torch.zeros(1), DENSITY, torch.Generator())[0] == 0
    assert len(made) == 1


def test_moving_ones_are_split_in_time_or_in_space():
    made = model(10, pulses=True)
    split(made, torch.arange(10), torch.Generator().manual_seed(0))
    centers = made.table["time_centers_s"].detach()
    in_time = centers != 0.5
    assert 0 < int(in_time.sum()) < 20
    assert len(made) == 20 and bool(made.moving_mask.all())


def test_gradient_counts_only_what_was_seen():
    made = model(3)
    state = activate(made.table, 1)
    state.means.retain_grad()
    (state.means * torch.tensor([[1.0], [0.0], [2.0]])).sum().backward()
    gradient = GradientStatistics(3)
    cameras = ball_capture(views=2, times=2, held=()).cameras[torch.tensor([0])]
    gradient.add(state.means, pinhole_ndc_scale(state.means.detach(), cameras))
    mean = gradient.mean()
    assert mean[1] == 0 and mean[0] > 0 and mean[2] > 0
    gradient.reset()
    assert not gradient.mean().any()

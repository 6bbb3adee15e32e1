"""Gaussians are split where the picture pulls, and faint ones go."""

import math
from dataclasses import replace

import torch
from small_fits import ball_capture

from diff4splat.fitting.canonical import activated, raw_points
from diff4splat.fitting.density import Pull, flat_half_pictures, grow_and_prune, split
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.spacetime import Pulses
from diff4splat.fitting.motions.still import Still
from diff4splat.fitting.settings import Density
from diff4splat.scene.gaussians import Gaussians

DENSITY = Density(budget=100, growth=0.5, min_gradient=1e-6)


def model(count: int = 10, pulses: bool = False) -> SceneModel:
    capture = ball_capture(views=2, times=2, held=())
    points = replace(
        capture.points,
        positions=capture.points.positions[:count],
        rgb=capture.points.rgb[:count],
    )
    motion = Pulses((0.0, 1.0), 0.05) if pulses else Still((0.0, 1.0))
    return SceneModel(raw_points(points, 1), motion, torch.full((count,), pulses))


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
    before = activated(made.table, 1)
    mean, spread = before.means.detach().clone(), covariance(before).detach()
    split(made, torch.tensor([0]), torch.Generator().manual_seed(0))
    after = activated(made.table, 1)
    assert len(after) == 2
    torch.testing.assert_close(after.means.detach().mean(0), mean[0])
    torch.testing.assert_close(covariance(after).detach(), spread, rtol=1e-5, atol=1e-7)


def test_a_split_in_time_keeps_the_moments_of_time_and_the_line_of_motion():
    motion = Pulses((0.0, 1.0), 0.01)
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
    pull = torch.zeros(10)
    pull[3], pull[7] = 1.0, 0.5
    dropped, count = grow_and_prune(made, pull, DENSITY, torch.Generator())
    assert (dropped, count, len(made)) == (0, 2, 12)
    for _ in range(8):
        grow_and_prune(made, torch.ones(len(made)), replace(DENSITY, budget=20), torch.Generator())
    assert len(made) == 20


def test_faint_and_broken_gaussians_are_dropped_but_never_all():
    made = model(10)
    with torch.no_grad():
        made.table["opacity_logits"][:9] = -9.0
    dropped, _ = grow_and_prune(made, torch.zeros(10), DENSITY, torch.Generator())
    assert (dropped, len(made)) == (9, 1)
    with torch.no_grad():
        made.table["opacity_logits"][:] = -9.0
    assert grow_and_prune(made, torch.zeros(1), DENSITY, torch.Generator())[0] == 0
    assert len(made) == 1


def test_moving_ones_are_split_in_time_or_in_space():
    made = model(10, pulses=True)
    split(made, torch.arange(10), torch.Generator().manual_seed(0))
    centers = made.table["time_centers_s"].detach()
    in_time = centers != 0.5
    assert 0 < int(in_time.sum()) < 20
    assert len(made) == 20 and bool(made.moves.all())


def test_pull_counts_only_what_was_seen():
    made = model(3)
    state = activated(made.table, 1)
    state.means.retain_grad()
    (state.means * torch.tensor([[1.0], [0.0], [2.0]])).sum().backward()
    pull = Pull(3)
    cameras = ball_capture(views=2, times=2, held=()).cameras[torch.tensor([0])]
    pull.add(state.means, flat_half_pictures(state.means.detach(), cameras))
    mean = pull.mean()
    assert mean[1] == 0 and mean[0] > 0 and mean[2] > 0
    pull.forget()
    assert not pull.mean().any()

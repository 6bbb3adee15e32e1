"""The sampler whose weights are fitted, against exact mixtures in float64."""

from functools import cache

import pytest
import torch
from oracles_flow import linear_clean, seeded_normal

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.flow.adaptive import StepControl
from diff4splat.flow.analytic_mixture import random_mixture
from diff4splat.flow.fitted import FittedSteps, fit_steps, integrate_fitted
from diff4splat.flow.guidance import CallCount, Guidance, guided
from diff4splat.flow.levels import make_levels
from diff4splat.flow.samplers import SAMPLERS, integrate
from diff4splat.flow.solve import SolverPath, solve
from diff4splat.generation.fitted_steps import known_steps
from diff4splat.generation.settings import GenerationSettings

LEVELS = make_levels("log_snr", 8)[:-1]
FIELD = random_mixture(3, components=4, dimensions=12, stds=(0.05, 0.5)).velocity


@cache
def states(seed: int) -> dict[float, torch.Tensor]:
    """Exact trajectories at all levels: midpoint, 100 steps between two."""
    state, found = seeded_normal(64, 12, seed=seed), {}
    for first, last in zip((*LEVELS, None), (*LEVELS[1:], 0.0, None), strict=True):
        if first is None:
            break
        found[first] = state
        between = [first + (last - first) * i / 100 for i in range(100)] + [last]
        state = integrate(SAMPLERS["midpoint"], FIELD, state, between)
    return {**found, 0.0: state}


@cache
def fitted_to_mixture() -> FittedSteps:
    return fit_steps(FIELD, states(0)[1.0], LEVELS, states(0).__getitem__)


def error(end: torch.Tensor, seed: int) -> float:
    wrong = (end - states(seed)[0.0]).norm(dim=1) / states(seed)[0.0].norm(dim=1)
    return float(wrong.square().mean().sqrt())


def test_beats_euler_on_trajectories_that_it_was_not_fitted_to() -> None:
    fitted, euler = 0.0, 0.0
    for seed in (1, 2):
        start = states(seed)[1.0]
        fitted += error(integrate_fitted(FIELD, start, fitted_to_mixture()), seed) ** 2
        euler += error(integrate(SAMPLERS["euler"], FIELD, start, (*LEVELS, 0.0)), seed) ** 2
    assert fitted < 0.5 * euler


def test_finds_the_weights_that_made_the_states() -> None:
    """Clean predictions that depend on the level alone: the rows have a closed form."""
    slope, base = seeded_normal(1, 40, seed=4), seeded_normal(1, 40, seed=5)
    noise = seeded_normal(1, 40, seed=6)
    rows = ((1.0,), (-0.3, 1.3), (0.2, -0.4, 1.2))
    want = FittedSteps(levels=(1.0, 0.6, 0.2), weights=rows)
    velocity = linear_clean(slope, base)
    clean = {level: base + slope * level for level in want.levels}
    made = {}
    for row, level in zip(rows, (0.6, 0.2, 0.0), strict=True):
        mean = sum(w * clean[a] for w, a in zip(row, want.levels, strict=False))
        made[level] = level * noise + (1 - level) * mean
    torch.testing.assert_close(integrate_fitted(velocity, noise, want), made[0.0])
    got = fit_steps(velocity, noise, want.levels, made.__getitem__)
    ends = [integrate_fitted(velocity, noise, one) for one in (got, want)]
    # A small ridge shares weight among predictions that are alike.
    torch.testing.assert_close(*ends, rtol=0, atol=1e-3)


@pytest.mark.parametrize("count", [8, 12])
def test_the_shipped_rows_keep_straight_paths_and_points_exact(count: int) -> None:
    clean, noise, steps = seeded_normal(2, 3), seeded_normal(2, 3, seed=1), known_steps()[count]
    straight = integrate_fitted(lambda x, level: noise - clean, noise, steps)
    torch.testing.assert_close(straight, clean, rtol=0, atol=1e-9)
    point = integrate_fitted(lambda x, level: (x - clean) / level, noise, steps)
    torch.testing.assert_close(point, clean, rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [8, 12])
def test_the_shipped_rows_solve_an_exact_mixture_about_as_well_as_multistep(count: int) -> None:
    """A field that they were never fitted to: nothing breaks."""
    mixture = random_mixture(2, components=4, dimensions=12, stds=(0.3, 0.6))
    start, steps = seeded_normal(32, 12, seed=7), known_steps()[count]
    fine = integrate(SAMPLERS["midpoint"], mixture.velocity, start, make_levels("uniform", 400))
    ends = [
        integrate_fitted(mixture.velocity, start, steps),
        integrate(SAMPLERS["euler"], mixture.velocity, start, make_levels("uniform", count)),
    ]
    ours, euler = ((end - fine).norm() / fine.norm() for end in ends)
    assert ours < 1.5 * euler


def test_one_evaluation_per_row_and_progress() -> None:
    count, ticks = CallCount(), []
    field = guided(FIELD, FIELD, Guidance(weight=5.0, low=0.2), count)
    steps = known_steps()[12]
    integrate_fitted(field, seeded_normal(2, 12), steps, advance=lambda: ticks.append(1))
    assert count.total == len(ticks) == 12
    assert count.unconditional == sum(level >= 0.2 for level in steps.levels)


def test_gradient_and_empty_batch() -> None:
    steps = FittedSteps(levels=(1.0, 0.5), weights=((1.0,), (-0.5, 1.5)))
    start = seeded_normal(1, 2).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: integrate_fitted(lambda s, a: s**2, x, steps), start)
    assert integrate_fitted(lambda s, a: s, torch.zeros(0, 3), steps).shape == (0, 3)
    assert integrate_fitted(lambda s, a: s, torch.ones(1, 1).half(), steps).dtype == torch.float32


def test_equal_predictions_are_no_reason_to_fail() -> None:
    point, start = seeded_normal(1, 3), seeded_normal(1, 3, seed=1)
    steps = fit_steps(
        lambda x, a: (x - point) / a, start, (1.0, 0.5), lambda a: a * start + (1 - a) * point
    )
    torch.testing.assert_close(
        integrate_fitted(lambda x, a: (x - point) / a, start, steps), point, rtol=0, atol=1e-9
    )


@pytest.mark.parametrize(
    ("levels", "weights", "words"),
    [
        ((1.0, 0.5), ((1.0,),), "expected rows of 1 to 2 weights"),
        ((1.0, 0.5), ((1.0,), (0.5, 0.6)), "expected rows that sum to 1"),
        ((0.5, 1.0), ((1.0,), (0.5, 0.5)), "expected each below the one before"),
    ],
)
def test_wrong_tables_are_refused(levels: tuple, weights: tuple, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        FittedSteps(levels=levels, weights=weights)


def test_is_a_solver_for_the_steps_that_were_fitted() -> None:
    settings = GenerationSettings(sampler="fitted", steps=12)
    assert settings.levels == (*known_steps()[12].levels, 0.0)
    with pytest.raises(ConfigError, match="--steps: expected 8 or 12 with --sampler fitted, got 9"):
        GenerationSettings(sampler="fitted", steps=9)
    path = SolverPath(levels=settings.levels, control=StepControl())
    with pytest.raises(ConfigError, match="expected fitted steps, got none"):
        solve("fitted", FIELD, torch.ones(1, 12), path)


def test_refuses_a_velocity_that_would_broadcast() -> None:
    steps = FittedSteps(levels=(1.0,), weights=((1.0,),))
    with pytest.raises(ShapeError, match="expected the state's shape"):
        integrate_fitted(lambda x, level: x[:1], torch.ones(2, 3), steps)

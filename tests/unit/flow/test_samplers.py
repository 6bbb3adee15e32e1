import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import (
    decay,
    decay_solution,
    gaussian_trajectory,
    linear_clean,
    linear_clean_solution,
    seeded_normal,
    slope_of,
    square,
    square_solution,
)

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.levels import log_snr_levels, make_levels, uniform_levels
from diff4splat.flow.samplers import SAMPLERS, Sampler, find_sampler, integrate

samplers = pytest.mark.parametrize("sampler", SAMPLERS.values(), ids=SAMPLERS)
IN_LEVEL = [name for name in SAMPLERS if name not in ("dpmpp2m", "unipc")]
samplers_in_level = pytest.mark.parametrize(
    "sampler", [SAMPLERS[n] for n in IN_LEVEL], ids=IN_LEVEL
)
STEPS = [64, 128, 256]


def gaussian(mean: float, std: float) -> GaussianMixture:
    return GaussianMixture(
        means=torch.full((1, 1), mean, dtype=torch.float64),
        stds=torch.full((1, 1), std, dtype=torch.float64),
        log_weights=torch.zeros(1, dtype=torch.float64),
    )


def between(first: float, last: float, steps: int) -> list[float]:
    return [first + (last - first) * i / steps for i in range(steps)] + [last]


def final_error(sampler: Sampler, field: Callable, exact: torch.Tensor, path: tuple) -> float:
    start, levels = path
    return float((integrate(sampler, field, start, levels) - exact).abs())


@samplers_in_level
@pytest.mark.parametrize(
    ("field", "solution", "last"), [(decay, decay_solution, 0.0), (square, square_solution, 0.5)]
)
def test_shows_its_declared_order(
    sampler: Sampler, field: Callable, solution: Callable, last: float
) -> None:
    """Into level 0 the nonlinear field shows 2.2: multistep2's error there is h² log h."""
    start = torch.full((1, 1), 0.6, dtype=torch.float64)
    exact = solution(start, 1.0, last)
    errors = [final_error(sampler, field, exact, (start, between(1.0, last, n))) for n in STEPS]
    assert slope_of(errors, STEPS) == pytest.approx(sampler.order, abs=0.1)


@samplers_in_level
@pytest.mark.parametrize("std", [0.5, 1.0])
def test_reaches_its_order_on_gaussian_data(sampler: Sampler, std: float) -> None:
    """At least: on Gaussian data the leading error of the midpoint rule cancels."""
    normal = torch.full((1, 1), 1.3, dtype=torch.float64)
    exact = gaussian_trajectory(0.7, std, normal, 0.0)
    field, steps = gaussian(0.7, std).velocity, [24, 48]
    errors = [final_error(sampler, field, exact, (normal, uniform_levels(n))) for n in steps]
    assert slope_of(errors, steps) > sampler.order - 0.1


@samplers
@pytest.mark.parametrize("schedule", ["uniform", "log_snr"])
def test_a_straight_path_is_exact(sampler: Sampler, schedule: str) -> None:
    clean, noise = seeded_normal(2, 3, 4), seeded_normal(2, 3, 4, seed=1)
    for steps in (1, 2, 7):
        levels = make_levels(schedule, steps)
        got = integrate(sampler, lambda x, level: noise - clean, noise, levels)
        torch.testing.assert_close(got, clean, rtol=0, atol=1e-12)


@samplers
@pytest.mark.parametrize("schedule", ["uniform", "log_snr"])
def test_data_in_one_point_is_exact(sampler: Sampler, schedule: str) -> None:
    point, start = seeded_normal(1, 3), seeded_normal(1, 3, seed=1)
    for steps in (1, 2, 9):
        levels = make_levels(schedule, steps, shift=3.0)
        got = integrate(sampler, lambda x, level: (x - point) / level, start, levels)
        torch.testing.assert_close(got, point, rtol=0, atol=1e-10)


@pytest.mark.parametrize("steps", [2, 5])
def test_multistep_is_exact_where_the_clean_prediction_is_linear(steps: int) -> None:
    start, slope, base = (seeded_normal(1, 3, seed=s) for s in range(3))
    levels = between(1.0, 0.3, steps)
    got = integrate(SAMPLERS["multistep2"], linear_clean(slope, base), start, levels)
    want = linear_clean_solution(start, slope, base, 0.3)
    torch.testing.assert_close(got, want, rtol=0, atol=1e-12)


@samplers
@pytest.mark.parametrize("last", [0.0, 0.25])
@pytest.mark.parametrize("steps", [1, 2, 6])
def test_makes_the_declared_number_of_calls(sampler: Sampler, last: float, steps: int) -> None:
    visited = []

    def count(state: torch.Tensor, level: float) -> torch.Tensor:
        visited.append(level)
        return decay(state, level)

    levels = between(1.0, last, steps)
    integrate(sampler, count, torch.ones(1, 1), levels)
    per_step = sampler.calls_per_step
    into_zero = sampler.calls_into_zero if last == 0 else per_step
    assert len(visited) == sampler.calls(levels) == per_step * (steps - 1) + into_zero
    assert min(visited) > 0, "no sampler may need the velocity of clean data"
    assert all(isinstance(level, float) for level in visited)


@samplers
@pytest.mark.parametrize("schedule", ["uniform", "log_snr"])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_thin_data_do_not_blow_up(sampler: Sampler, schedule: str, dtype: torch.dtype) -> None:
    normal = torch.tensor([[-2.0], [0.0], [3.0]], dtype=dtype)
    mixture = gaussian(0.7, 1e-6)
    thin = GaussianMixture(
        means=mixture.means.to(dtype),
        stds=mixture.stds.to(dtype),
        log_weights=mixture.log_weights.to(dtype),
    )
    got = integrate(sampler, thin.velocity, normal, make_levels(schedule, 12))
    torch.testing.assert_close(got, torch.full_like(normal, 0.7), rtol=0, atol=1e-5)


def relative_errors(sampler: Sampler, levels: tuple[float, ...]) -> torch.Tensor:
    """End-point errors on a thin mixture, one per trajectory."""
    mixture, start = random_mixture(1, dimensions=24), seeded_normal(32, 24, seed=7)
    fine = integrate(SAMPLERS["midpoint"], mixture.velocity, start, uniform_levels(300))
    got = integrate(sampler, mixture.velocity, start, levels)
    return (got - fine).norm(dim=1) / fine.norm(dim=1)


def test_multistep_beats_euler_at_equal_calls_on_a_stiff_field() -> None:
    levels = log_snr_levels(16)
    multistep = relative_errors(SAMPLERS["multistep2"], levels).median()
    euler = relative_errors(SAMPLERS["euler"], levels).median()
    assert multistep < 0.25 * euler


def test_multistep_stays_bounded_where_steps_grow() -> None:
    """Ten times longer steps each time: plain extrapolation would multiply the change by ten."""
    levels = [1.0, 0.999, 0.99, 0.9, 0.0]
    errors = relative_errors(SAMPLERS["multistep2"], tuple(levels))
    assert errors.max() < 1.5


@samplers
def test_runs_do_not_remember_each_other(sampler: Sampler) -> None:
    start, levels = seeded_normal(2, 3), uniform_levels(5)
    first = integrate(sampler, decay, start, levels)
    integrate(sampler, decay, seeded_normal(4, 2), levels)
    assert torch.equal(integrate(sampler, decay, start, levels), first)


@settings(max_examples=25, deadline=None)
@given(name=st.sampled_from(sorted(SAMPLERS)), scale=st.floats(-3, 3), steps=st.integers(1, 6))
def test_is_linear_in_the_state_for_a_linear_field(name: str, scale: float, steps: int) -> None:
    start, levels = seeded_normal(2, 3), uniform_levels(steps)
    scaled = integrate(SAMPLERS[name], decay, scale * start, levels)
    torch.testing.assert_close(scaled, scale * integrate(SAMPLERS[name], decay, start, levels))


@samplers
def test_gradient(sampler: Sampler) -> None:
    start = seeded_normal(1, 2).requires_grad_()
    levels = log_snr_levels(4)
    assert torch.autograd.gradcheck(lambda x: integrate(sampler, square, 0.1 * x, levels), (start,))


@samplers
@pytest.mark.parametrize(
    ("given_dtype", "kept"),
    [
        (torch.float64, torch.float64),
        (torch.float32, torch.float32),
        (torch.bfloat16, torch.float32),
        (torch.float16, torch.float32),
    ],
)
def test_the_state_is_never_half_precision(
    sampler: Sampler, given_dtype: torch.dtype, kept: torch.dtype
) -> None:
    seen = []

    def network(state: torch.Tensor, level: float) -> torch.Tensor:
        seen.append(state.dtype)
        return state.bfloat16()

    got = integrate(sampler, network, torch.ones(1, 2, dtype=given_dtype), uniform_levels(3))
    assert got.dtype == kept
    assert set(seen) == {kept}


@samplers
def test_many_small_steps_survive_a_bfloat16_network(sampler: Sampler) -> None:
    def network(state: torch.Tensor, level: float) -> torch.Tensor:
        return torch.full_like(state, 2.0).bfloat16()

    got = integrate(sampler, network, torch.full((1, 1), 100.0), uniform_levels(200))
    assert float(got) == pytest.approx(98.0, abs=1e-2)


@samplers
def test_empty_batch_and_progress(sampler: Sampler) -> None:
    ticks = []
    got = integrate(
        sampler, decay, torch.zeros(0, 3), uniform_levels(4), advance=lambda: ticks.append(1)
    )
    assert got.shape == (0, 3)
    assert len(ticks) == 4


@samplers
@pytest.mark.parametrize("extreme", [0.0, 1e-30, 1e30])
def test_value_and_gradient_are_finite_on_extreme_states(sampler: Sampler, extreme: float) -> None:
    start = torch.full((1, 1), extreme, dtype=torch.float64, requires_grad=True)
    got = integrate(sampler, decay, start, log_snr_levels(8))
    got.sum().backward()
    assert bool(got.isfinite().all())
    assert bool(start.grad.isfinite().all())


def test_refuses_levels_that_stand_still() -> None:
    with pytest.raises(ConfigError, match="levels: expected each below the one before"):
        integrate(SAMPLERS["euler"], decay, torch.ones(1, 1), [1.0, 0.5, 0.5])


def test_refuses_whole_numbers(as_shipped: None) -> None:
    with pytest.raises(ShapeError, match="start: expected floating-point numbers"):
        integrate(SAMPLERS["euler"], decay, torch.ones(1, 1, dtype=torch.long), [1.0, 0.0])


@samplers
def test_refuses_a_velocity_that_would_broadcast(sampler: Sampler) -> None:
    with pytest.raises(ShapeError, match=r"expected the state's shape \(2, 3\), got \(1, 3\)"):
        integrate(sampler, lambda x, level: x[:1], torch.ones(2, 3), [1.0, 0.5, 0.0])


def test_names() -> None:
    assert all(find_sampler(name).name == name for name in SAMPLERS)
    with pytest.raises(ConfigError, match=f"sampler: expected one of {', '.join(SAMPLERS)}, got"):
        find_sampler("ddim")


def test_heun_ends_with_an_euler_step() -> None:
    start = torch.full((1, 1), 1.0, dtype=torch.float64)
    got = integrate(SAMPLERS["heun"], decay, start, [0.5, 0.0])
    assert float(got) == pytest.approx(1.0 + 0.5 * math.cos(0.5))

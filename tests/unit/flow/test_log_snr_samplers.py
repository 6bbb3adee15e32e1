"""DPM-Solver++(2M) and UniPC against solutions in closed form."""

import itertools
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import gaussian_trajectory, seeded_normal, slope_of, square, square_solution

from diff4splat.flow import log_snr_samplers
from diff4splat.flow.analytic_mixture import GaussianMixture, random_mixture
from diff4splat.flow.levels import log_snr_levels, uniform_levels
from diff4splat.flow.samplers import SAMPLERS, integrate

NAMES = ("dpmpp2m", "unipc")
names = pytest.mark.parametrize("name", NAMES)


def gaussian(mean: float, std: float) -> GaussianMixture:
    return GaussianMixture(
        means=torch.full((1, 1), mean, dtype=torch.float64),
        stds=torch.full((1, 1), std, dtype=torch.float64),
        log_weights=torch.zeros(1, dtype=torch.float64),
    )


def evenly(first: float, last: float, steps: int) -> list[float]:
    return [first + (last - first) * i / steps for i in range(steps)] + [last]


@pytest.mark.parametrize(("name", "order"), [("dpmpp2m", 2), ("unipc", 3)])
def test_order_between_the_ends(name: str, order: float) -> None:
    """UniPC's corrector adds one order (its authors' Corollary 3.2); the ends hide it."""
    start, steps = torch.full((1, 1), 0.6, dtype=torch.float64), [64, 128, 256]
    exact = square_solution(start, 0.9, 0.5)
    errors = [
        float((integrate(SAMPLERS[name], square, start, evenly(0.9, 0.5, n)) - exact).abs())
        for n in steps
    ]
    assert slope_of(errors, steps) == pytest.approx(order, abs=0.05)


@pytest.mark.parametrize(("name", "order"), [("dpmpp2m", 1.7), ("unipc", 2.0)])
@pytest.mark.parametrize("std", [0.5, 1.0])
def test_order_from_noise_to_data(name: str, order: float, std: float) -> None:
    """h² log h: steps in λ never become small beside levels 0 and 1."""
    normal, steps = torch.full((1, 1), 1.3, dtype=torch.float64), [128, 512]
    exact = gaussian_trajectory(0.7, std, normal, 0.0)
    field = gaussian(0.7, std).velocity
    errors = [
        float((integrate(SAMPLERS[name], field, normal, uniform_levels(n)) - exact).abs())
        for n in steps
    ]
    assert slope_of(errors, steps) > order


@settings(max_examples=30, deadline=None)
@given(
    step=st.floats(1e-6, 30),
    degree=st.sampled_from([0, 1, 2]),
)
def test_moments_are_those_of_the_exponential(step: float, degree: int) -> None:
    u = torch.linspace(0, step, 20_001, dtype=torch.float64)
    weight = torch.exp(u - step)
    mean = torch.trapezoid(weight * (u / step) ** degree, u) / torch.trapezoid(weight, u)
    want = (1.0, *log_snr_samplers._moments(step))[degree]
    assert float(mean) == pytest.approx(want, rel=1e-5)


def test_the_corrector_is_exact_where_predictions_are_quadratic_in_lambda() -> None:
    """Predictions that depend on the level alone: D = λ². The integral is in closed form."""
    levels = [0.8, 0.7, 0.55, 0.45]

    def prediction(level: float) -> float:
        return log_snr_samplers.log_snr(level) ** 2

    def velocity(state: torch.Tensor, level: float) -> torch.Tensor:
        return (state - prediction(level)) / level

    start = torch.full((1, 1), 0.3, dtype=torch.float64)
    memory, state = None, start
    for pair in itertools.pairwise(levels):
        state, memory = SAMPLERS["unipc"].step(velocity, state, pair, memory)
    again = log_snr_samplers._correct(
        memory, levels[-1], torch.full((1, 1), prediction(levels[-1]), dtype=torch.float64)
    )
    low, high = (log_snr_samplers.log_snr(level) for level in levels[-2:])
    u = torch.linspace(low, high, 200_001, dtype=torch.float64)
    integral = torch.trapezoid(torch.exp(u - high) * u**2, u)
    exact = levels[-1] / levels[-2] * memory.state + (1 - levels[-1]) * integral
    torch.testing.assert_close(again, exact, rtol=1e-9, atol=1e-9)


@names
def test_beats_euler_at_equal_calls_on_a_stiff_field(name: str) -> None:
    mixture, start = random_mixture(1, dimensions=24), seeded_normal(32, 24, seed=7)
    fine = integrate(SAMPLERS["midpoint"], mixture.velocity, start, uniform_levels(300))
    errors = {
        one: (integrate(SAMPLERS[one], mixture.velocity, start, log_snr_levels(16)) - fine)
        .norm(dim=1)
        .median()
        for one in (name, "euler")
    }
    assert errors[name] < 0.4 * errors["euler"]


@names
@pytest.mark.parametrize("std", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("levels", [(1.0, 0.0), (1.0, 0.5, 0.0), (1.0, 1 - 1e-12, 1e-12, 0.0)])
def test_ends_are_finite_with_their_gradient(name: str, std: float, levels: tuple) -> None:
    start = torch.full((1, 1), 0.5, dtype=torch.float64, requires_grad=True)
    got = integrate(SAMPLERS[name], gaussian(0.7, std).velocity, start, levels)
    got.sum().backward()
    assert bool(got.isfinite().all())
    assert bool(start.grad.isfinite().all())


def test_log_snr_ends_and_middle() -> None:
    values = [log_snr_samplers.log_snr(level) for level in (1.0, 0.5, 0.0)]
    assert values == [-math.inf, 0.0, math.inf]

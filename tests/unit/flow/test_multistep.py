"""Where plain multistep steps go wrong: velocities that jump, and strong guidance at few steps."""

import pytest
import torch
from oracles_flow import linear_clean, linear_clean_solution, seeded_normal, slope_of

from diff4splat.errors import ShapeError
from diff4splat.flow.analytic_mixture import random_mixture
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, CallCount, Guidance, guided
from diff4splat.flow.levels import piecewise_levels
from diff4splat.flow.samplers import SAMPLERS, integrate
from diff4splat.generation.settings import GenerationSettings
from diff4splat.stability.subjects import sampler_fields

PIECEWISE = SAMPLERS["piecewise2"]
START = seeded_normal(16, 12, seed=3)
INTERVAL = Guidance(weight=4.0, low=0.2, high=0.9)


def guided_mixture(guidance: Guidance, count: CallCount | None = None):
    mixture = random_mixture(2, components=4, dimensions=12, stds=(0.3, 0.6))
    preferred = mixture.with_weights(torch.tensor([2.0, -2.0, -2.0, -2.0], dtype=torch.float64))
    return guided(preferred.velocity, mixture.velocity, guidance, count)


def pieces(steps: int) -> tuple[float, ...]:
    """Even in each piece down to level 0.1, where the flow is still smooth."""
    ends, shares = (1.0, 0.9, 0.2, 0.1), (1, 6, 1)
    levels = [
        high + (low - high) * i / (share * steps)
        for high, low, share in zip(ends, ends[1:], shares, strict=False)
        for i in range(share * steps)
    ]
    return (*levels, ends[-1])


def exact_end() -> torch.Tensor:
    """Midpoint between the jumps, on the side of the interval that holds there."""
    state = START
    for first, last in ((1.0, 0.9), (0.9, 0.2), (0.2, 0.1)):
        weight = INTERVAL.weight if last == 0.2 else 1.0
        field = guided_mixture(Guidance(weight=weight))
        levels = [first + (last - first) * i / 200 for i in range(200)] + [last]
        state = integrate(SAMPLERS["midpoint"], field, state, levels)
    return state


def test_keeps_its_order_across_both_ends_of_the_guidance_interval() -> None:
    exact, steps, errors = exact_end(), [4, 8, 16], {}
    for name in ("piecewise2", "multistep2"):
        ends = [
            integrate(SAMPLERS[name], guided_mixture(INTERVAL), START, pieces(n)) for n in steps
        ]
        errors[name] = [float((end - exact).norm() / exact.norm()) for end in ends]
    assert slope_of(errors["piecewise2"], steps) > 1.8
    # Differences across a jump leave multistep2 at order 1.
    assert errors["piecewise2"][-1] < 0.5 * errors["multistep2"][-1]


def test_equals_multistep_where_nothing_jumps() -> None:
    velocity = guided_mixture(Guidance(weight=4.0))
    levels = [1 - i / 9 for i in range(9)] + [0.0]
    both = [integrate(SAMPLERS[n], velocity, START, levels) for n in ("piecewise2", "multistep2")]
    torch.testing.assert_close(*both)


def test_is_exact_for_linear_clean_predictions_that_jump() -> None:
    """The oracle follows both pieces in closed form."""
    slope, base = 0.2 * seeded_normal(16, 12, seed=4), seeded_normal(16, 12, seed=5)

    class Jumping:
        jumps, strong = (0.5,), False

        def __call__(self, state: torch.Tensor, level: float) -> torch.Tensor:
            return (above if level > 0.5 else below)(state, level)

        def sides(self, state: torch.Tensor, level: float) -> tuple[torch.Tensor, torch.Tensor]:
            return above(state, level), below(state, level)

    above, below = linear_clean(slope, base), linear_clean(-slope, base + 1)
    got = integrate(PIECEWISE, Jumping(), START, [1.0, 0.75, 0.5, 0.4, 0.3, 0.2])
    middle = linear_clean_solution(START, slope, base, 0.5)
    # From 0.5 on: state = base + C level - slope level ln(level), C from the state there.
    at_half = (middle - base - 1) / 0.5 - slope * torch.tensor(0.5).log()
    want = base + 1 + 0.2 * at_half + slope * 0.2 * torch.tensor(0.2).log()
    # Each piece ends with a predictor whose slope the next call would correct.
    assert float((got - want).abs().max()) < 0.02


def test_an_end_of_the_interval_costs_one_evaluation_of_both_branches() -> None:
    count = CallCount()
    levels = piecewise_levels(6, (0.9, 0.2))
    integrate(PIECEWISE, guided_mixture(INTERVAL, count), START, levels)
    assert count.total == 6
    inside = sum(0.2 <= level <= 0.9 for level in levels)
    assert (count.conditional, count.unconditional) == (6, inside)


def test_sides_are_checked_and_stay_in_the_dtype_of_the_state() -> None:
    class Wrong:
        jumps, strong = (0.5,), False

        def __call__(self, state: torch.Tensor, level: float) -> torch.Tensor:
            return state

        def sides(self, state: torch.Tensor, level: float) -> tuple[torch.Tensor, torch.Tensor]:
            return state, state[:1]

    with pytest.raises(ShapeError, match=r"expected the state's shape \(16, 12\), got \(1, 12\)"):
        integrate(PIECEWISE, Wrong(), START, [1.0, 0.5, 0.0])


@pytest.mark.parametrize("deviation", [1.0, 0.1, 1e-4])
def test_is_never_worse_than_euler_under_strong_guidance(deviation: float) -> None:
    weights = (10.0, 20.0, 30.0)
    exact = sampler_fields.exact_end_points(deviation, weights)
    for weight, want in zip(weights, exact, strict=True):
        field = sampler_fields.thin_data(deviation).velocity(weight)
        for steps in (2, 4, 8, 16):
            levels = GenerationSettings(steps=steps).levels
            ends = [
                integrate(SAMPLERS[name], field, sampler_fields.initial_noise(), levels)
                for name in ("euler", "multistep2", "piecewise2")
            ]
            euler, *ours = sampler_fields.end_point_errors(ends, [want] * 3)
            assert all(one.median() <= 1.05 * euler.median() + 1e-4 for one in ours)
            assert all((one > 0.3).sum() <= (euler > 0.3).sum() + 1 for one in ours)


def test_levels_of_settings_reach_the_ends_of_the_interval() -> None:
    settings = GenerationSettings(sampler="piecewise2", steps=12)
    assert DEFAULT_GUIDANCE.low in settings.levels

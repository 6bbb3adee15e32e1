import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import seeded_normal

from diff4splat.errors import ConfigError
from diff4splat.flow.guidance import CallCount, Guidance, guided, mix
from diff4splat.flow.levels import uniform_levels
from diff4splat.flow.samplers import SAMPLERS, integrate

STATE = torch.zeros(1, 2)


def conditional(state: torch.Tensor, level: float) -> torch.Tensor:
    return torch.full_like(state, 3.0 + level)


def unconditional(state: torch.Tensor, level: float) -> torch.Tensor:
    return torch.full_like(state, 1.0 - level)


def refuse(state: torch.Tensor, level: float) -> torch.Tensor:
    raise AssertionError("this branch must not be evaluated")


@settings(max_examples=25, deadline=None)
@given(weight=st.floats(0, 30), level=st.floats(0, 1))
def test_is_the_formula_inside_the_interval(weight: float, level: float) -> None:
    got = guided(conditional, unconditional, Guidance(weight=weight))(STATE.double(), level)
    want = (1 - level) + weight * ((3 + level) - (1 - level))
    torch.testing.assert_close(got, torch.full((1, 2), want, dtype=torch.float64))


def test_weight_one_never_asks_the_unconditional_branch() -> None:
    assert torch.equal(guided(conditional, refuse, Guidance())(STATE, 0.5), conditional(STATE, 0.5))
    assert torch.equal(guided(conditional, None, Guidance())(STATE, 0.5), conditional(STATE, 0.5))


def test_weight_zero_never_asks_the_conditional_branch() -> None:
    got = guided(refuse, unconditional, Guidance(weight=0.0))(STATE, 0.5)
    assert torch.equal(got, unconditional(STATE, 0.5))


def test_without_a_condition_only_the_unconditional_branch_is_asked() -> None:
    got = guided(None, unconditional, Guidance(weight=7.0))(STATE, 0.5)
    assert torch.equal(got, unconditional(STATE, 0.5))


@pytest.mark.parametrize("weight", [0.0, 5.0])
@pytest.mark.parametrize("level", [0.0, 0.19, 0.81, 1.0])
def test_outside_the_interval_the_condition_alone_counts(weight: float, level: float) -> None:
    call = guided(conditional, refuse, Guidance(weight=weight, low=0.2, high=0.8))
    assert torch.equal(call(STATE, level), conditional(STATE, level))


@pytest.mark.parametrize("level", [0.2, 0.8])
def test_the_interval_is_closed(level: float) -> None:
    call = guided(conditional, unconditional, Guidance(weight=2.0, low=0.2, high=0.8))
    want = 2 * conditional(STATE, level) - unconditional(STATE, level)
    torch.testing.assert_close(call(STATE, level), want)


@pytest.mark.parametrize("weight", [0.0, 1.0, 30.0])
def test_equal_branches_are_not_changed(weight: float) -> None:
    same = seeded_normal(2, 3, dtype=torch.float32)
    assert torch.equal(mix(same, same, weight), same)


@pytest.mark.parametrize("weight", [0.0, 1.0, 30.0])
def test_a_zero_unconditional_branch_only_scales(weight: float) -> None:
    velocity = seeded_normal(2, 3)
    assert torch.equal(mix(torch.zeros_like(velocity), velocity, weight), weight * velocity)


def test_half_precision_branches_are_mixed_in_float32() -> None:
    start, stop = torch.full((1,), 3e4).half(), torch.full((1,), -3e4).half()
    mixed = mix(start, stop, 30.0)
    assert mixed.dtype == torch.float32
    assert float(mixed) == pytest.approx(3e4 - 30 * 6e4, rel=1e-3)


def test_gradient() -> None:
    branches = [seeded_normal(2, 3, seed=s).requires_grad_() for s in range(2)]
    assert torch.autograd.gradcheck(lambda u, c: mix(u, c, 30.0), branches)


def test_counts_what_was_evaluated_and_what_was_saved() -> None:
    count = CallCount()
    velocity = guided(conditional, unconditional, Guidance(weight=4.0, low=0.25, high=0.75), count)
    integrate(SAMPLERS["euler"], velocity, STATE, uniform_levels(8))
    # Levels 1, 0.875, 0.75, ..., 0.125: five of eight lie inside the interval.
    assert (count.total, count.conditional, count.unconditional, count.saved) == (8, 8, 5, 3)


@pytest.mark.parametrize(
    ("branches", "guidance", "saved"),
    [
        ((conditional, unconditional), Guidance(weight=3.0), 0),
        ((conditional, unconditional), Guidance(), 1),
        ((conditional, unconditional), Guidance(weight=0.0), 1),
        ((None, unconditional), Guidance(weight=3.0), 1),
        ((None, unconditional), Guidance(), 1),
        ((conditional, None), Guidance(), 1),
    ],
)
def test_savings_of_one_answer(branches: tuple, guidance: Guidance, saved: int) -> None:
    count = CallCount()
    guided(*branches, guidance, count)(STATE, 0.5)
    assert count.saved == saved


def test_refuses_missing_branches() -> None:
    with pytest.raises(ConfigError, match="expected at least one branch, got none"):
        guided(None, None, Guidance())
    with pytest.raises(ConfigError, match=r"weight: expected 1 without an unconditional branch"):
        guided(conditional, None, Guidance(weight=3.0))


@pytest.mark.parametrize("weight", [-1.0, math.nan, math.inf])
def test_refuses_a_weight_that_is_no_weight(weight: float) -> None:
    with pytest.raises(ConfigError, match="guidance weight: expected 0 or above"):
        Guidance(weight=weight)


@pytest.mark.parametrize("interval", [(-0.1, 1.0), (0.6, 0.5), (0.0, 1.1), (math.nan, 1.0)])
def test_refuses_a_false_interval(interval: tuple[float, float]) -> None:
    with pytest.raises(ConfigError, match="guidance interval: expected 0 <= low <= high <= 1"):
        Guidance(weight=2.0, low=interval[0], high=interval[1])


def test_reads_as_weight_and_interval() -> None:
    assert str(Guidance(weight=6.0, low=0.2, high=0.9)) == "6 in [0.2, 0.9]"

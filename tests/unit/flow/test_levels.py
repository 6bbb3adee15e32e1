import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.flow.levels import (
    EDGE,
    log_snr_levels,
    make_levels,
    require_levels,
    shift_levels,
    uniform_levels,
)


@settings(max_examples=25, deadline=None)
@given(
    schedule=st.sampled_from(["uniform", "log_snr"]),
    steps=st.integers(1, 200),
    shift=st.floats(1e-3, 1e3),
)
def test_every_schedule_runs_from_one_to_zero(schedule: str, steps: int, shift: float) -> None:
    levels = make_levels(schedule, steps, shift)
    require_levels(levels)
    assert (levels[0], levels[-1], len(levels)) == (1.0, 0.0, steps + 1)


def test_uniform() -> None:
    assert uniform_levels(4) == (1.0, 0.75, 0.5, 0.25, 0.0)


def test_log_snr_is_evenly_spaced_and_symmetric() -> None:
    levels = log_snr_levels(10)[1:-1]
    gaps = [
        math.log(after / (1 - after)) - math.log(before / (1 - before))
        for before, after in pairwise(levels)
    ]
    # 1 - edge to edge in ten steps, edge = 0.016.
    want = 2 * math.log(EDGE / 10 / (1 - EDGE / 10)) / 10
    assert gaps == pytest.approx([want] * 8)
    assert levels == pytest.approx([1 - level for level in reversed(levels)])


def test_one_and_two_log_snr_steps() -> None:
    assert log_snr_levels(1) == (1.0, 0.0)
    assert log_snr_levels(2) == pytest.approx((1.0, 0.5, 0.0))


@settings(max_examples=25, deadline=None)
@given(level=st.floats(0, 1), shift=st.floats(0.01, 100))
def test_shift_is_the_published_formula(level: float, shift: float) -> None:
    want = shift * level / (1 + (shift - 1) * level)
    assert shift_levels([level], shift)[0] == pytest.approx(want, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(level=st.floats(0.01, 0.99), shift=st.floats(0.1, 10))
def test_a_shift_is_undone_by_its_inverse(level: float, shift: float) -> None:
    back = shift_levels(shift_levels([level], shift), 1 / shift)
    assert back[0] == pytest.approx(level)


def test_a_shift_of_one_changes_no_bit() -> None:
    levels = log_snr_levels(7)
    assert shift_levels(levels, 1.0) == levels


@pytest.mark.parametrize("shift", [0.0, -1.0, math.inf, math.nan])
def test_refuses_a_shift_that_is_not_positive(shift: float) -> None:
    with pytest.raises(ConfigError, match="shift: expected a finite number above 0"):
        shift_levels([1.0, 0.0], shift)


@pytest.mark.parametrize("make", [uniform_levels, log_snr_levels])
def test_refuses_no_steps(make: object) -> None:
    with pytest.raises(ConfigError, match="steps: expected at least 1, got 0"):
        make(0)


def test_refuses_an_unknown_schedule(as_shipped: None) -> None:
    with pytest.raises(ConfigError, match="schedule: expected one of uniform, log_snr, got"):
        make_levels("karras", 4)


@pytest.mark.parametrize(
    ("levels", "complaint"),
    [
        ([1.0], "at least two"),
        ([], "at least two"),
        ([1.0, 0.5, 0.5, 0.0], "each below the one before"),
        ([0.0, 1.0], "each below the one before"),
        ([1.5, 0.0], r"numbers in \[0, 1\]"),
        ([1.0, -0.1], r"numbers in \[0, 1\]"),
        ([1.0, math.nan, 0.0], r"numbers in \[0, 1\]"),
    ],
)
def test_refuses_levels_that_cannot_be_followed(levels: list[float], complaint: str) -> None:
    with pytest.raises(ConfigError, match=f"levels: expected .*{complaint}") as caught:
        require_levels(levels)
    assert "\n" not in str(caught.value)


def test_a_shift_that_runs_out_of_digits_says_what_to_do() -> None:
    with pytest.raises(ConfigError, match="fewer steps or a smaller shift"):
        require_levels(shift_levels(uniform_levels(1000), 1e30))

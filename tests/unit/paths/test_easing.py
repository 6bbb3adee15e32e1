from typing import get_args

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.paths.easing import Easing, ease, require_easing

ALL = get_args(Easing)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=2, max_size=20), st.sampled_from(ALL))
def test_easings_are_monotone_and_stay_in_range(progress: list[float], easing: Easing) -> None:
    eased = ease(torch.tensor(sorted(progress), dtype=torch.float64), easing)
    # One rounding step is allowed: the polynomial is evaluated in floating point.
    assert bool((eased.diff() >= -1e-15).all())
    assert bool(((eased >= 0) & (eased <= 1)).all())


@pytest.mark.parametrize("easing", ALL)
def test_ends_are_fixed(easing: Easing) -> None:
    ends = ease(torch.tensor([0.0, 1.0], dtype=torch.float64), easing)
    assert ends.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("easing", "quarter"),
    [("linear", 0.25), ("smooth", 3 / 16 - 2 / 64), ("ease-in", 1 / 16), ("ease-out", 1 - 9 / 16)],
)
def test_values_at_a_quarter(easing: Easing, quarter: float) -> None:
    assert float(ease(torch.tensor([0.25], dtype=torch.float64), easing)) == pytest.approx(quarter)


@pytest.mark.parametrize(
    ("easing", "slopes"), [("smooth", (0, 0)), ("ease-in", (0, 2)), ("ease-out", (2, 0))]
)
def test_speeds_at_the_ends(easing: Easing, slopes: tuple[int, int]) -> None:
    progress = torch.tensor([0.0, 1.0], dtype=torch.float64, requires_grad=True)
    ease(progress, easing).sum().backward()
    assert progress.grad is not None
    assert progress.grad.tolist() == pytest.approx(list(slopes))


def test_unknown_easing_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"easing: expected one of linear.*did you mean 'smooth'"):
        require_easing("smoth")

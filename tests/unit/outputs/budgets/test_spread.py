"""The error that new inputs stay below."""

import math
import random

import pytest

from diff4splat.outputs.budgets.spread import upper_bound


@pytest.mark.parametrize(
    ("errors", "bound"),
    [([0.5], 0.5), ([0.0, 0.0, 0.0], 0.0), ([2.0, 2.0, 2.0], 2.0), ([0.0, 1.0], 1.0)],
)
def test_without_spread_the_largest_is_the_bound(errors: list[float], bound: float) -> None:
    assert upper_bound(errors) == pytest.approx(bound)


def test_the_formula() -> None:
    # Logarithms 0, 1, 2: mean 1, deviation 1, and t of 2 degrees of freedom is 2.92.
    errors = [math.exp(k) for k in range(3)]
    assert upper_bound(errors) == pytest.approx(math.exp(1 + 2.920 * math.sqrt(4 / 3)))


@pytest.mark.parametrize("count", [4, 7])
def test_nineteen_of_twenty_new_errors_stay_below(count: int) -> None:
    draw = random.Random(count)
    held = 0
    for _ in range(2000):
        errors = [math.exp(draw.gauss(-3, 1.2)) for _ in range(count + 1)]
        held += errors[-1] <= upper_bound(errors[:-1])
    assert 0.93 < held / 2000 < 0.975

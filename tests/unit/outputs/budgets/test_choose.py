"""The setting that limits ask for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.outputs.budgets.choose import Choice, agrees, broken, choose
from diff4splat.outputs.budgets.costs import Forecast
from diff4splat.outputs.budgets.limits import Limits, error_from_loss


def choice(seconds: float, error: float, memory_bytes: float = 1e9) -> Choice:
    cost = Forecast(seconds=float(seconds), cpu_seconds=float(seconds), memory_bytes=memory_bytes)
    return Choice(values={"steps": int(seconds)}, expected=cost, error=error)


OPTIONS = (choice(1, 1e-2), choice(4, 1e-4), choice(5, 1e-3), choice(9, 1e-6, 3e9))


def test_a_tolerance_takes_the_cheapest_that_holds() -> None:
    assert choose(OPTIONS, Limits(tolerance_db=0.5)) == OPTIONS[1]
    assert choose(OPTIONS, Limits(tolerance_db=20.0)) == OPTIONS[0]


def test_a_budget_takes_the_most_exact_that_fits() -> None:
    assert choose(OPTIONS, Limits(seconds=20.0)) == OPTIONS[3]
    assert choose(OPTIONS, Limits(seconds=20.0, memory_bytes=2e9)) == OPTIONS[1]
    assert choose(OPTIONS, Limits(seconds=2.0)) == OPTIONS[0]


def test_both_must_hold() -> None:
    with pytest.raises(ConfigError, match=r"--budget: expected at least .* within 0.5 dB"):
        choose(OPTIONS, Limits(tolerance_db=0.5, seconds=3.0))


def test_messages_say_what_is_possible() -> None:
    with pytest.raises(ConfigError, match=r"expected at least \S+ dB, which is reached in 9.0 s"):
        choose(OPTIONS, Limits(tolerance_db=1e-5))
    with pytest.raises(ConfigError, match=r"expected at least 1.2 s and 1.1 GB"):
        choose(OPTIONS, Limits(seconds=0.1))
    with pytest.raises(ConfigError, match="leave one of them out"):
        choose((), Limits(seconds=1.0))


@given(st.floats(0.05, 20))
def test_a_chosen_setting_holds_or_nothing_does(loss_db: float) -> None:
    limits = Limits(tolerance_db=loss_db)
    assert choose(OPTIONS, limits).error <= error_from_loss(loss_db)


def test_what_the_user_gave_is_never_overridden() -> None:
    assert agrees({"steps": 7, "infill": "none"}, {"steps": 7})
    assert not agrees({"steps": 3}, {"steps": 7})


def test_a_broken_limit_is_one_line() -> None:
    limits = Limits(tolerance_db=0.5, seconds=10.0)
    assert broken(limits, {"loss_db": 0.4, "seconds": 9}) is None
    line = broken(limits, {"loss_db": 0.8, "seconds": 12})
    assert "0.5 dB, got 0.8" in line and "10 s, got 12" in line and "\n" not in line

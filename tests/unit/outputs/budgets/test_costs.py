"""Costs from rates, and rates from runs."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.outputs.budgets.costs import CostRates, forecast, free_cores
from diff4splat.outputs.budgets.rates_fit import fit_rates
from diff4splat.outputs.budgets.speed import measure_speed_s, require_comparable

RATES = CostRates(
    seconds={"start": 2.0, "filmed_pixels": 1e-3}, memory_bytes={"start": 5e8, "gaussians": 100.0}
)
WORK = {"start": 1, "filmed_pixels": 4000, "gaussians": 1e6}


def test_parallel_work_is_shared_by_the_cores() -> None:
    alone = forecast(RATES, WORK, speed=1.0, cores=2.0)
    assert alone.cpu_seconds == pytest.approx(6)
    assert alone.seconds == pytest.approx(2 + 4 / 2)
    assert alone.memory_bytes == pytest.approx(6e8)


def test_half_a_core_takes_twice_as_long() -> None:
    assert forecast(RATES, WORK, speed=1.0, cores=0.5).seconds == pytest.approx(12)


@given(st.floats(0.2, 5))
def test_time_follows_the_speed_and_memory_does_not(speed: float) -> None:
    made, plain = (forecast(RATES, WORK, one, cores=1.0) for one in (speed, 1.0))
    assert made.seconds == pytest.approx(speed * plain.seconds)
    assert made.memory_bytes == plain.memory_bytes


def test_free_cores_of_a_loaded_machine() -> None:
    assert free_cores(load=0.0, cores=2) == 2
    assert free_cores(load=2.0, cores=2) == 1
    assert 0 < free_cores(load=1e6, cores=2) < 1e-3


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(0, 10), min_size=3, max_size=3),
    st.lists(st.lists(st.floats(0.1, 10), min_size=3, max_size=3), min_size=6, max_size=8),
)
def test_fitted_rates_are_never_negative_and_predict_consistent_runs(
    rates: list[float], amounts: list[list[float]]
) -> None:
    work = [dict(zip("abc", row, strict=True)) for row in amounts]
    measured = [sum(r * a for r, a in zip(rates, row, strict=True)) + 1e-3 for row in amounts]
    found = fit_rates(work, measured)
    assert min(found.values()) >= 0
    for one, seconds in zip(work, measured, strict=True):
        predicted = sum(found[name] * amount for name, amount in one.items())
        assert predicted == pytest.approx(seconds, rel=0.05, abs=2e-2)


def test_an_amount_that_no_run_had_has_no_rate() -> None:
    assert fit_rates([{"a": 1, "b": 0}, {"a": 2, "b": 0}], [3, 6]) == {
        "a": pytest.approx(3, rel=1e-3)
    }


def test_the_speed_is_the_geometric_mean_of_two_parts() -> None:
    ticks = iter(range(1000))
    assert measure_speed_s(lambda: float(next(ticks))) == pytest.approx(1.0)


@pytest.mark.parametrize("speed", [0.01, 20.0, float("nan")])
def test_machines_that_are_too_different_are_refused(speed: float) -> None:
    assert require_comparable(1.5, "x") == 1.5
    with pytest.raises(ConfigError, match="report calibrate"):
        require_comparable(speed, "Linux x86_64, 64 cores")

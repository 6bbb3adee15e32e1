import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.sweep import Measurement, SweepResult, steps_of, sweep
from diff4splat.errors import ConfigError


class Laboratory:
    """Runs that take as long as they are told, on a clock that only they move."""

    def __init__(self, costs: dict[object, list[float]]) -> None:
        self.now, self.costs, self.log = 0.0, costs, []

    def run(self, setting: object) -> torch.Tensor:
        self.log.append(setting)
        times = self.costs[setting]
        self.now += times[min(self.log.count(setting), len(times)) - 1]
        return torch.tensor(float(setting))

    def clock(self) -> float:
        return self.now


def knob(run: Callable, settings: tuple, reference: object = 0) -> ApproximationSetting:
    return ApproximationSetting(
        name="toy",
        summary="something",
        error_unit="distance",
        settings=settings,
        default=settings[0],
        reference=reference,
        run=run,
        error=lambda result, best: float((result - best).abs()),
    )


def row(seconds: float, error: float, setting: object = None) -> Measurement:
    name = (seconds, error) if setting is None else setting
    return Measurement(
        setting=name, label="", series="", seconds=seconds, median_s=seconds, error=error
    )


def result(rows: list[Measurement]) -> SweepResult:
    made = knob(torch.tensor, tuple(row.setting for row in rows))
    return SweepResult(knob=made, repeats=1, rows=tuple(rows))


def test_measures_after_a_warm_up_and_interleaves() -> None:
    laboratory = Laboratory({0: [50.0], 3: [9.0, 2.0, 1.0, 4.0], 5: [90.0, 7.0, 8.0, 9.0]})
    ticks: list[int] = []
    measured = sweep(
        knob(laboratory.run, (3, 5)), 3, advance=lambda: ticks.append(1), clock=laboratory.clock
    )
    assert laboratory.log == [0, 3, 5, 3, 5, 3, 5, 3, 5]
    assert [(r.seconds, r.median_s, r.error) for r in measured.rows] == [(1, 2, 3), (7, 8, 5)]
    assert len(ticks) == steps_of(measured.knob, 3) == 9


def test_a_result_with_nan_is_as_wrong_as_can_be() -> None:
    def run(setting: float) -> torch.Tensor:
        return torch.tensor(setting)

    measured = sweep(knob(run, (1.0, math.nan, math.inf), reference=0.0), 1)
    assert [r.error for r in measured.rows] == [1.0, math.inf, math.inf]
    assert [r.setting for r in measured.pareto()] == [1.0]


def test_labels_and_series_come_from_the_knob() -> None:
    made = ApproximationSetting(
        name="toy",
        summary="something",
        error_unit="distance",
        settings=(1, 2),
        default=2,
        reference=2,
        run=torch.tensor,
        error=lambda result, best: float(result - best) ** 2,
        series=lambda setting: "odd" if setting % 2 else "even",
        label=lambda setting: f"<{setting}>",
    )
    measured = sweep(made, 1)
    assert [(r.series, r.label) for r in measured.rows] == [("odd", "<1>"), ("even", "<2>")]
    assert measured.default.setting == 2


@pytest.mark.parametrize("repeats", [0, -1])
def test_refuses_no_repeats(repeats: int) -> None:
    with pytest.raises(ConfigError, match=f"repeats: expected at least 1, got {repeats}"):
        sweep(knob(torch.tensor, (1,)), repeats)


costs = st.lists(
    st.tuples(st.sampled_from([1.0, 2.0, 3.0, 5.0]), st.sampled_from([0.0, 0.1, 0.2, math.inf])),
    min_size=1,
    max_size=8,
    unique=True,
)


def dominated(row: Measurement, rows: list[Measurement]) -> bool:
    return any(
        other.seconds <= row.seconds
        and other.error <= row.error
        and (other.seconds, other.error) != (row.seconds, row.error)
        for other in rows
    )


@settings(max_examples=50, deadline=None)
@given(points=costs)
def test_the_front_is_exactly_what_nothing_dominates(points: list[tuple[float, float]]) -> None:
    rows = [row(*point) for point in points]
    want = {r.setting for r in rows if math.isfinite(r.error) and not dominated(r, rows)}
    front = result(rows).pareto()
    assert {r.setting for r in front} == want
    assert list(front) == sorted(front, key=lambda r: r.seconds)

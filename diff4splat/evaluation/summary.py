"""Means with intervals, paired differences to the best baseline, and which items to look at.

Intervals are bootstrap intervals over items: they say how much the mean depends on which clips were
drawn, not how good the measure is. Differences are taken item by item, so that what makes a clip
hard for everybody cancels.
"""

from collections import Counter
from dataclasses import dataclass

import torch

from diff4splat.evaluation.baselines import BASELINES
from diff4splat.evaluation.columns import PRIMARY, SYSTEM, Column, columns_of
from diff4splat.evaluation.protocol import Protocol
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.runner import Outcome
from diff4splat.metrics.bootstrap import bootstrap_interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Mean:
    """A mean over items with its interval."""

    value: float
    low: float | None
    """None for a single item, which says nothing about the spread; likewise ``high``."""
    high: float | None
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One row and column of the table."""

    row: str
    key: str
    mean: Mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How much better the system is than the best baseline of a column; above 0 is better."""

    key: str
    baseline: str
    mean: Mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Skipped:
    """How many items did not allow a measure."""

    row: str
    key: str
    why: str
    items: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """All that a table says."""

    cells: tuple[Cell, ...]
    differences: tuple[Difference, ...]
    skipped: tuple[Skipped, ...]
    ranking: tuple[ItemResult, ...]
    """Items by the primary measure of the system, best first."""

    def cell(self, row: str, key: str) -> Mean | None:
        """One mean, if anything was measured."""
        return next((c.mean for c in self.cells if (c.row, c.key) == (row, key)), None)

    def difference(self, key: str) -> Difference | None:
        """Against the best baseline of a column, if there is one."""
        return next((d for d in self.differences if d.key == key), None)

    def shown(self) -> tuple[tuple[str, ItemResult], ...]:
        """Best, median and worst item; fewer when there are fewer."""
        last = len(self.ranking) - 1
        places = (
            {"best": 0, "worst": last}
            if last < 2
            else {"best": 0, "median": last // 2, "worst": last}
        )
        names = {place: name for name, place in reversed(places.items()) if last >= 0}
        return tuple((names[place], self.ranking[place]) for place in sorted(names))


def summarize(outcome: Outcome) -> Summary:
    """The table of a run."""
    protocol, items = outcome.setup.protocol, outcome.items
    columns = columns_of(outcome.setup.task)
    cells = tuple(
        Cell(row=row, key=column.key, mean=interval(values, protocol))
        for row in (SYSTEM, *BASELINES)
        for column in columns
        if (values := taken(items, row, column.key))
    )
    differences = [_difference(items, column, cells, protocol) for column in columns]
    return Summary(
        cells=cells,
        differences=tuple(one for one in differences if one is not None),
        skipped=_skipped(items),
        ranking=ranked(items, next(c for c in columns if c.key == PRIMARY[outcome.setup.task])),
    )


def taken(items: tuple[ItemResult, ...], row: str, key: str) -> list[float]:
    """The scores of a row and column, over the items that have one."""
    values = [item.value(row, key) for item in items]
    return [value for value in values if value is not None]


def gains(items: tuple[ItemResult, ...], column: Column, baseline: str) -> list[float]:
    """Per item, how much better the system is than ``baseline``."""
    pairs = [(item.value(SYSTEM, column.key), item.value(baseline, column.key)) for item in items]
    return [column.sign * (own - other) for own, other in pairs if None not in (own, other)]


def ranked(items: tuple[ItemResult, ...], column: Column) -> tuple[ItemResult, ...]:
    """Items that have the measure, best first; equals keep their order."""
    having = [item for item in items if item.value(SYSTEM, column.key) is not None]
    return tuple(sorted(having, key=lambda item: -column.sign * item.value(SYSTEM, column.key)))


def interval(values: list[float], protocol: Protocol) -> Mean:
    """Mean and bootstrap interval of at least one value."""
    settings = protocol.bootstrap
    numbers = torch.tensor(values, dtype=torch.float64)
    found = bootstrap_interval(numbers, settings.coverage, settings.resamples, protocol.seed)
    low, high = (found.low, found.high) if len(values) > 1 else (None, None)
    return Mean(value=found.mean, low=low, high=high, count=len(values))


def _difference(
    items: tuple[ItemResult, ...], column: Column, cells: tuple[Cell, ...], protocol: Protocol
) -> Difference | None:
    rivals = [cell for cell in cells if cell.key == column.key and cell.row != SYSTEM]
    if not rivals or column.better == "neither":
        return None
    best = max(rivals, key=lambda cell: column.sign * cell.mean.value).row
    values = gains(items, column, best)
    if not values:
        return None
    return Difference(key=column.key, baseline=best, mean=interval(values, protocol))


def _skipped(items: tuple[ItemResult, ...]) -> tuple[Skipped, ...]:
    counted = Counter((skip.row, skip.key, skip.why) for item in items for skip in item.skips)
    return tuple(
        Skipped(row=row, key=key, why=why, items=count)
        for (row, key, why), count in sorted(counted.items())
    )

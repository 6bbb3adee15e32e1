"""Means with intervals, paired differences to the best baseline, and a ranking of items.

Intervals are bootstrap intervals over items: the uncertainty from the choice of clips. Differences
are paired by item, so that the difficulty of a clip cancels.
"""

from collections import Counter
from dataclasses import dataclass

import torch

from diff4splat.evaluation.columns import PRIMARY, SYSTEM, Column, columns_of
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.systems.baselines import BASELINES
from diff4splat.evaluation.systems.inpainting import METHODS
from diff4splat.evaluation.systems.variants import EXTENSION
from diff4splat.metrics.bootstrap import bootstrap_interval

FILLS = (EXTENSION, *METHODS)
"""Baselines that fill what the image hides, on the depth and the motion of the system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mean:
    """A mean over items with its interval."""

    value: float
    low: float | None
    """None for a single item; likewise ``high``."""
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
    """Mean improvement of the system over another row in a column; above 0 is better."""

    key: str
    baseline: str
    mean: Mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Skipped:
    """Number of items for which a metric is undefined."""

    row: str
    key: str
    why: str
    items: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Content of the results table."""

    cells: tuple[Cell, ...]
    differences: tuple[Difference, ...]
    skipped: tuple[Skipped, ...]
    comparisons: tuple[Difference, ...]
    """Of every row but the system's: how much better the system is."""
    ranking: tuple[ItemResult, ...]
    """Items sorted by the primary metric of the system, best first."""

    def cell(self, row: str, key: str) -> Mean | None:
        """The mean of one cell; None if it is empty."""
        return next((c.mean for c in self.cells if (c.row, c.key) == (row, key)), None)

    def difference(self, key: str) -> Difference | None:
        """The difference to the best baseline of a column, if any."""
        return next((d for d in self.differences if d.key == key), None)

    def comparison(self, row: str, key: str) -> Mean | None:
        """How much better the system is than a row; None without both values."""
        rows = (d.mean for d in self.comparisons if (d.baseline, d.key) == (row, key))
        return next(rows, None)

    def examples(self) -> tuple[tuple[str, ItemResult], ...]:
        """Best, median and worst item; fewer if there are fewer items."""
        last = len(self.ranking) - 1
        indices = (
            {"best": 0, "worst": last}
            if last < 2
            else {"best": 0, "median": last // 2, "worst": last}
        )
        names = {index: name for name, index in reversed(indices.items()) if last >= 0}
        return tuple((names[index], self.ranking[index]) for index in sorted(names))


def summarize(outcome: Outcome) -> Summary:
    """Summarise a run."""
    protocol, items = outcome.setup.protocol, outcome.items
    columns = columns_of(outcome.setup.task)
    cells = tuple(
        Cell(row=row, key=column.key, mean=interval(values, protocol))
        for row in row_names(outcome)
        for column in columns
        if (values := collect_values(items, row, column.key))
    )
    differences = [_difference(items, column, cells, protocol) for column in columns]
    return Summary(
        cells=cells,
        differences=tuple(row for row in differences if row is not None),
        comparisons=_comparisons(outcome),
        skipped=_skipped(items),
        ranking=sort_items(items, next(c for c in columns if c.key == PRIMARY[outcome.setup.task])),
    )


def row_names(outcome: Outcome) -> tuple[str, ...]:
    """Rows of the table in order: system, baselines, fills, variants."""
    variants = [variant.row for variant in outcome.setup.variants]
    return (SYSTEM, *BASELINES, *FILLS, *variants)


def collect_values(items: tuple[ItemResult, ...], row: str, key: str) -> list[float]:
    """Values of a row and column, over the items that have one."""
    values = [item.value(row, key) for item in items]
    return [value for value in values if value is not None]


def paired_differences(items: tuple[ItemResult, ...], column: Column, baseline: str) -> list[float]:
    """Improvement of the system over ``baseline``, per item."""
    pairs = [(item.value(SYSTEM, column.key), item.value(baseline, column.key)) for item in items]
    return [column.sign * (a - b) for a, b in pairs if None not in (a, b)]


def sort_items(items: tuple[ItemResult, ...], column: Column) -> tuple[ItemResult, ...]:
    """Items that have the metric, best first; a stable sort."""
    measured = [item for item in items if item.value(SYSTEM, column.key) is not None]
    return tuple(sorted(measured, key=lambda item: -column.sign * item.value(SYSTEM, column.key)))


def interval(values: list[float], protocol: Protocol) -> Mean:
    """Mean and bootstrap interval of at least one value."""
    settings = protocol.bootstrap
    numbers = torch.tensor(values, dtype=torch.float64)
    result = bootstrap_interval(numbers, settings.coverage, settings.resamples, protocol.seed)
    low, high = (result.low, result.high) if len(values) > 1 else (None, None)
    return Mean(value=result.mean, low=low, high=high, count=len(values))


def _difference(
    items: tuple[ItemResult, ...], column: Column, cells: tuple[Cell, ...], protocol: Protocol
) -> Difference | None:
    candidates = [cell for cell in cells if cell.key == column.key and cell.row in BASELINES]
    if not candidates or column.better == "neither":
        return None
    best = max(candidates, key=lambda cell: column.sign * cell.mean.value).row
    values = paired_differences(items, column, best)
    if not values:
        return None
    return Difference(key=column.key, baseline=best, mean=interval(values, protocol))


def _comparisons(outcome: Outcome) -> tuple[Difference, ...]:
    """The system against every other row, in all columns that have a direction."""
    protocol, items = outcome.setup.protocol, outcome.items
    return tuple(
        Difference(key=column.key, baseline=row, mean=interval(values, protocol))
        for row in row_names(outcome)[1:]
        for column in columns_of(outcome.setup.task)
        if column.better != "neither" and (values := paired_differences(items, column, row))
    )


def _skipped(items: tuple[ItemResult, ...]) -> tuple[Skipped, ...]:
    counted = Counter((skip.row, skip.key, skip.why) for item in items for skip in item.skips)
    return tuple(
        Skipped(row=row, key=key, why=why, items=count)
        for (row, key, why), count in sorted(counted.items())
    )

"""Distances between the videos of each row and the true ones, as distributions over items.

Axes: ``n`` items, ``d`` features. Every row is compared over the items in which it and the truth
have a video. Intervals are of the jackknife over items.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float64
from torch import Tensor

from diff4splat.evaluation.columns import TRUTH
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.report.cells import head, line, mean_text
from diff4splat.evaluation.report.summary import Mean, row_names
from diff4splat.evaluation.runner import Outcome
from diff4splat.metrics.distribution import LEAST_SAMPLES, frechet_distance, kernel_distance
from diff4splat.metrics.jackknife import jackknife_interval

Distance = Callable[[Tensor, Tensor], float]
DISTANCES: dict[str, Distance] = {
    "Fréchet distance": frechet_distance,
    # Both videos of an item show one world.
    "kernel distance": partial(kernel_distance, paired=True),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DistributionDistance:
    """One distance of one row."""

    row: str
    distance: str
    mean: Mean


def distribution_distances(outcome: Outcome) -> tuple[DistributionDistance, ...]:
    """All distances of all rows that have videos of at least two items."""
    found = []
    for row in row_names(outcome):
        samples = _paired(outcome.items, row)
        if samples is None:
            continue
        coverage = outcome.setup.protocol.bootstrap.coverage
        for name, distance in DISTANCES.items():
            mean = _interval(distance, *samples, coverage)
            found.append(DistributionDistance(row=row, distance=name, mean=mean))
    return tuple(found)


def distribution_section(
    outcome: Outcome, distances: Sequence[DistributionDistance], names: dict[str, str]
) -> list[str]:
    """The table of distances, with ``names`` shown for rows; empty without video features."""
    if not distances or outcome.setup.videos.distribution is None:
        return []
    cells = {(one.row, one.distance): one.mean for one in distances}
    rows = list(dict.fromkeys(one.row for one in distances))
    lines = [
        "## Distribution of videos",
        "",
        f"Generated against true videos along the path; {outcome.setup.videos.distribution.name}. "
        "The Fréchet distance of few videos is too large; the kernel distance is unbiased.",
        "",
        *head([f"{name} ↓" for name in DISTANCES]),
    ]
    for row in rows:
        values = [mean_text(cells[row, name]) for name in DISTANCES]
        lines.append(line([names.get(row, row), *values]))
    return lines


def _paired(
    items: Sequence[ItemResult], row: str
) -> tuple[Float64[Tensor, "n d"], Float64[Tensor, "n d"]] | None:
    pairs = [(item.embedding(row), item.embedding(TRUTH)) for item in items]
    both = [pair for pair in pairs if None not in pair]
    if len(both) < LEAST_SAMPLES:
        return None
    one, truth = (torch.tensor(side, dtype=torch.float64) for side in zip(*both, strict=True))
    return one, truth


def _interval(distance: Distance, one: Tensor, truth: Tensor, coverage: float) -> Mean:
    def of_items(index: Sequence[int]) -> float:
        chosen = list(index)
        return distance(one[chosen], truth[chosen])

    found = jackknife_interval(of_items, len(one), coverage)
    low, high = (None, None) if math.isnan(found.low) else (found.low, found.high)
    return Mean(value=found.mean, low=low, high=high, count=len(one))

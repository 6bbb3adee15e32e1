"""Where each sampler stops being usable: thin data, strong guidance, few steps."""

from collections.abc import Iterator
from functools import partial
from itertools import groupby

from torch import Tensor

from diff4splat.flow.samplers import SAMPLERS
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite
from diff4splat.stability.plots import HeatMap
from diff4splat.stability.subjects.sampler_fields import (
    end_point_errors,
    end_points,
    exact_end_points,
)

GROUP = "samplers"
DEVIATIONS = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6)
WEIGHTS = (1.0, 3.0, 6.0, 10.0, 20.0, 30.0)
STEPS = (2, 4, 8, 16, 32, 64)
USABLE_ERROR, USABLE_STRAYS = 0.05, 0.05
"""Median error, and share of trajectories that end more than STRAY away."""
STRAY = 0.3


def sampler_checks() -> Iterator[Check]:
    """One check per sampler and deviation; its error is the largest at the most steps."""
    for name in SAMPLERS:
        for deviation in DEVIATIONS:
            yield Check(
                group=GROUP,
                name=f"{name}, data deviation {deviation:g}",
                run=partial(measure_sampler, name, deviation),
                limit=USABLE_ERROR,
                error_unit=f"median end point, worst guidance, {STEPS[-1]} steps",
                quick=name == "multistep2" and deviation in (1.0, 1e-6),
            )


def measure_sampler(name: str, deviation: float) -> Outcome:
    """Errors over guidance and steps, as a heat map."""
    exact = exact_end_points(deviation, WEIGHTS)
    values, usable, finite = [], [], True
    for steps in STEPS:
        ends = [end_points(name, steps, deviation, weight) for weight in WEIGHTS]
        finite = finite and all_finite(ends)
        errors = end_point_errors(ends, list(exact))
        values.append([float(median) for median in errors.median(1).values])
        usable.append(_usable(errors))
    # One row of the map per guidance.
    rows = tuple(zip(*values, strict=True))
    cells = tuple(zip(*usable, strict=True))
    return Outcome(
        error=max(row[-1] for row in rows),
        value_finite=finite,
        note=_usable_from(cells),
        plots=(_heat_map(name, deviation, rows, cells),),
    )


def _usable(errors: Tensor) -> list[bool]:
    """Per guidance weight."""
    strays = (errors > STRAY).double().mean(1)
    median = errors.median(1).values
    return ((median <= USABLE_ERROR) & (strays <= USABLE_STRAYS)).tolist()


def _usable_from(cells: tuple[tuple[bool, ...], ...]) -> str:
    """The fewest steps from which on every number of steps is usable."""
    fewest = []
    for row in cells:
        bad = [index for index, fine in enumerate(row) if not fine]
        first = bad[-1] + 1 if bad else 0
        fewest.append(f"{STEPS[first]} steps" if first < len(STEPS) else "no number of steps")
    runs = [(steps, list(run)) for steps, run in groupby(zip(fewest, WEIGHTS, strict=True), _first)]
    parts = [f"{steps} at guidance {_range([pair[1] for pair in run])}" for steps, run in runs]
    return "usable from " + ", ".join(parts)


def _first(pair: tuple[str, float]) -> str:
    return pair[0]


def _range(weights: list[float]) -> str:
    """One weight, or the first and the last of several."""
    low, high = weights[0], weights[-1]
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _heat_map(
    name: str,
    deviation: float,
    values: tuple[tuple[float, ...], ...],
    usable: tuple[tuple[bool, ...], ...],
) -> HeatMap:
    return HeatMap(
        title=f"{name}, σ {deviation:g}",
        row_label="guidance",
        rows=tuple(f"{weight:g}" for weight in WEIGHTS),
        column_label="steps",
        columns=tuple(map(str, STEPS)),
        values=values,
        within_limit=usable,
    )

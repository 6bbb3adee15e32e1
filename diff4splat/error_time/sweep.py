"""Measure every setting of a knob: seconds and error, the Pareto front, the best choice in limits.

Timings are interleaved (all settings once, then all again), so that a machine that slows down does
not favour the settings that came first. The fastest of the repeats counts: other programs can only
make a run slower. The first run of each setting warms up caches and gives the error.
"""

import math
import statistics
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.errors import ConfigError

Clock = Callable[[], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One setting: its cost and how far its result is from the reference."""

    setting: Hashable
    label: str
    series: str
    seconds: float
    """Fastest of the repeats."""
    median_s: float
    error: float
    """Infinite where the result is not finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepResult:
    """All settings of one knob, in the knob's order."""

    knob: ApproximationSetting
    repeats: int
    rows: tuple[Measurement, ...]

    @property
    def default(self) -> Measurement:
        """The row of the knob's default setting."""
        return next(row for row in self.rows if row.setting == self.knob.default)

    def pareto(self) -> tuple[Measurement, ...]:
        """Rows that no other row beats in both time and error, fastest first."""
        front: list[Measurement] = []
        for row in sorted(self.rows, key=lambda row: (row.seconds, row.error)):
            if math.isfinite(row.error) and (not front or row.error < front[-1].error):
                front.append(row)
        return tuple(front)

    def cheapest_within(self, tolerance: float) -> Measurement:
        """The fastest row with an error of at most ``tolerance``.

        Raises:
            ConfigError: no setting is that exact.
        """
        fitting = [row for row in self.rows if row.error <= tolerance]
        if not fitting:
            best = min(self.rows, key=lambda row: row.error)
            raise ConfigError(
                f"tolerance: expected at least {best.error:.3g} ({self.knob.error_unit}), "
                f"reached by {self.knob.name} {best.setting}, got {tolerance:.3g}"
            )
        return min(fitting, key=lambda row: row.seconds)

    def best_within(self, budget_s: float) -> Measurement:
        """The most exact row that takes at most ``budget_s`` seconds.

        Raises:
            ConfigError: no setting is that fast.
        """
        fitting = [row for row in self.rows if row.seconds <= budget_s]
        if not fitting:
            fastest = min(self.rows, key=lambda row: row.seconds)
            raise ConfigError(
                f"budget: expected at least {fastest.seconds:.3g} s, "
                f"taken by {self.knob.name} {fastest.setting}, got {budget_s:.3g} s"
            )
        return min(fitting, key=lambda row: row.error)


def sweep(
    knob: ApproximationSetting,
    repeats: int = 3,
    advance: Callable[[], None] = lambda: None,
    clock: Clock = time.perf_counter,
) -> SweepResult:
    """Run the reference once and every setting ``1 + repeats`` times.

    ``advance`` is called ``steps_of(knob, repeats)`` times.

    Raises:
        ConfigError: ``repeats`` is below 1.
    """
    if repeats < 1:
        raise ConfigError(f"repeats: expected at least 1, got {repeats}")
    reference = knob.run(knob.reference)
    advance()
    errors = []
    for setting in knob.settings:
        errors.append(_finite(knob.error(knob.run(setting), reference)))
        advance()
    seconds: list[list[float]] = [[] for _ in knob.settings]
    for _ in range(repeats):
        for setting, taken in zip(knob.settings, seconds, strict=True):
            began = clock()
            knob.run(setting)
            taken.append(clock() - began)
            advance()
    measured = zip(knob.settings, seconds, errors, strict=True)
    return SweepResult(knob=knob, repeats=repeats, rows=tuple(_row(knob, *row) for row in measured))


def steps_of(knob: ApproximationSetting, repeats: int) -> int:
    """How many runs ``sweep`` makes."""
    return 1 + len(knob.settings) * (1 + repeats)


def _row(
    knob: ApproximationSetting, setting: Hashable, seconds: list[float], error: float
) -> Measurement:
    return Measurement(
        setting=setting,
        label=knob.label(setting),
        series=knob.series(setting),
        seconds=min(seconds),
        median_s=statistics.median(seconds),
        error=error,
    )


def _finite(error: float) -> float:
    """A result with NaN in it is as wrong as can be, and must not sort below everything."""
    return error if math.isfinite(error) else math.inf

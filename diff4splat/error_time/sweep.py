"""Measure every setting of a knob: seconds and error, and the Pareto front.

Timings are interleaved (all settings once, then all again), so that a machine that slows down does
not favour the settings that came first. The fastest of the repeats counts: other programs can only
make a run slower. The first run of each setting warms up caches and gives the error.
"""

import math
import statistics
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import torch

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.errors import ConfigError
from diff4splat.progress.peak_memory import PeakMemory

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
    more_errors: Mapping[str, float] = field(default_factory=dict)
    """By other measures, under their names with units."""
    peak_bytes: int | None = None
    """Memory that the first run took at most beyond what was in use; None where unknown."""

    @property
    def name(self) -> str:
        """Of the setting, in words."""
        return self.label if self.setting is None else str(self.setting)


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


def sweep(
    knob: ApproximationSetting,
    repeats: int = 3,
    advance: Callable[[], None] = lambda: None,
    clock: Clock | None = None,
    known: Mapping[Hashable, Measurement] | None = None,
) -> SweepResult:
    """Run the reference once and every setting ``1 + repeats`` times, or as the knob says.

    ``advance`` is called ``steps_of`` times. Settings in ``known`` are not run again. Without a
    ``clock`` it is ``fitting_clock``.

    Raises:
        ConfigError: ``repeats`` is below 1.
    """
    if repeats < 1:
        raise ConfigError(f"repeats: expected at least 1, got {repeats}")
    repeats, known, clock = repeats_of(knob, repeats), known or {}, clock or fitting_clock()
    missing = [setting for setting in knob.settings if setting not in known]
    firsts = dict(_first_runs(knob, missing, advance, clock)) if missing else {}
    seconds: dict[Hashable, list[float]] = {one: [] for one in missing}
    for _ in range(repeats):
        for setting, taken in seconds.items():
            began = clock()
            knob.run(setting)
            taken.append(clock() - began)
            advance()
    made = {one: _timed(firsts[one], seconds[one]) for one in missing}
    rows = (known[one] if one in known else made[one] for one in knob.settings)
    return SweepResult(knob=knob, repeats=repeats, rows=tuple(rows))


def fitting_clock() -> Clock:
    """Processor time of one thread, which other programs hardly lengthen; else time by the clock.

    With several threads processor time would be the sum over them.
    """
    return time.process_time if torch.get_num_threads() == 1 else time.perf_counter


def steps_of(knob: ApproximationSetting, repeats: int, known: int = 0) -> int:
    """How many runs ``sweep`` makes, with ``known`` settings left out."""
    missing = len(knob.settings) - known
    return 1 + missing * (1 + repeats_of(knob, repeats)) if missing else 0


def repeats_of(knob: ApproximationSetting, repeats: int) -> int:
    """The knob's own number of timed runs, or the one that is asked for."""
    return repeats if knob.repeats is None else knob.repeats


def _first_runs(
    knob: ApproximationSetting,
    settings: list[Hashable],
    advance: Callable[[], None],
    clock: Clock,
) -> Iterator[tuple[Hashable, Measurement]]:
    """Errors and memory of every setting; the first run also warms up."""
    reference = knob.run_reference() if knob.run_reference else knob.run(knob.reference)
    advance()
    for setting in settings:
        with PeakMemory() as memory:
            began = clock()
            result = knob.run(setting)
            taken = clock() - began
        yield (
            setting,
            Measurement(
                setting=setting,
                label=knob.label(setting),
                series=knob.series(setting),
                seconds=taken,
                median_s=taken,
                error=_finite(knob.error(result, reference)),
                more_errors=knob.more_errors(result, reference),
                peak_bytes=memory.peak_bytes,
            ),
        )
        advance()


def _timed(first: Measurement, seconds: list[float]) -> Measurement:
    """``first`` with the seconds of the runs after it, if there are any."""
    if not seconds:
        return first
    return replace(first, seconds=min(seconds), median_s=statistics.median(seconds))


def _finite(error: float) -> float:
    """A result with NaN in it is as wrong as can be, and must not sort below everything."""
    return error if math.isfinite(error) else math.inf

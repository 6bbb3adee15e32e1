"""What the whole report measured, and what of it comes first."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.evaluation.skipped.measurement import Measured
from diff4splat.progress.machine import Machine
from diff4splat.stability.check import Record
from diff4splat.stability.tables import count_verdicts

VIDEO_SAMPLING, STEPWISE = "video-sampling", "euler"
STATIC = "all together, static and without a prompt"


@dataclass(frozen=True, slots=True, kw_only=True)
class FullReport:
    """Results of all parts, with the pictures that were drawn of them."""

    machine: Machine
    seconds: float
    knobs: Sequence[SweepResult]
    plots: Sequence[Path]
    """One for each of ``knobs``."""
    skipped: Sequence[Measured]
    skipped_plot: Path
    records: Sequence[Record]


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """One number, what it is, and what it is compared with."""

    number: str
    what: str
    detail: str
    good: bool


def headlines(report: FullReport) -> list[Headline]:
    """What a reader wants to know first; those whose part was not measured are left out."""
    found = [_sampler(report), _static(report), _stability(report), _defaults(report)]
    return [one for one in found if one is not None]


def _sampler(report: FullReport) -> Headline | None:
    rows = [row for one in report.knobs if one.knob.name == VIDEO_SAMPLING for row in one.rows]
    counted = [(int(row.label), row) for row in rows if row.label.isdigit()]
    steps = [one for one in counted if one[1].series == STEPWISE]
    if not steps:
        return None
    most, last = max(steps, key=lambda one: one[0])
    as_good = [one for one in counted if one[1].error <= last.error]
    fewest, best = min(as_good, key=lambda one: (one[0], one[1].error))
    detail = (
        f"by {best.series}: latent error {best.error:.3f}; "
        f"{last.series} has {last.error:.3f} with {most}"
    )
    return Headline(
        number=str(fewest),
        what="evaluations of the video model",
        detail=detail,
        good=fewest < most,
    )


def _static(report: FullReport) -> Headline | None:
    rows = [row for row in report.skipped if row.item == STATIC]
    if not rows:
        return None
    share = median(row.lean_s / row.full_s for row in rows)
    error = max(row.error for row in rows)
    same = "same bits" if error == 0 else f"largest difference {error:.1e}"
    return Headline(
        number=f"{share:.0%}",
        what="of the full path's time",
        detail=f"for a static scene without a prompt, {same}, {len(rows)} inputs",
        good=share <= 0.5,
    )


def _stability(report: FullReport) -> Headline | None:
    counts = count_verdicts(report.records)
    if not report.records:
        return None
    return Headline(
        number=str(counts["ok"]),
        what=f"of {len(report.records)} extreme inputs ok",
        detail=f"{counts['refused']} refused with a message, {counts['fails']} fail, "
        f"{counts['not run']} not run",
        good=counts["fails"] == 0,
    )


def _defaults(report: FullReport) -> Headline | None:
    if not report.knobs:
        return None
    on_front = [one for one in report.knobs if _is_on_front(one.default, one)]
    return Headline(
        number=f"{len(on_front)} of {len(report.knobs)}",
        what="defaults on the front",
        detail="nothing measured is both faster and more exact",
        good=2 * len(on_front) >= len(report.knobs),
    )


def _is_on_front(row: Measurement, result: SweepResult) -> bool:
    return any(row.setting == one.setting for one in result.pareto())

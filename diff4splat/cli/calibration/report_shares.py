"""The whole report in shares, so that two processes measure at a time.

Knobs of one share have references in common. Shares that take longest come first.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from diff4splat.cli.calibration.shares import Share
from diff4splat.cli.calibration.skipped import INPUTS, Skipped
from diff4splat.error_time import report as error_time
from diff4splat.error_time.known_knobs import known_knobs
from diff4splat.error_time.sweep import Measurement, SweepResult, repeats_of, steps_of
from diff4splat.progress.phases import Phases
from diff4splat.stability import report as stability
from diff4splat.stability.check import Outcome, Record
from diff4splat.stability.known_checks import known_checks

KNOBS = {
    "video": ("video-", "motion-", "block-"),
    "fill": ("fill-", "precision-dit", "precision-vae", "precision-ldrm"),
    "scenes": (
        *("precision-", "runtime", "network-", "color-", "subpixel-", "static-", "key-times"),
        *("scene-", "vae-", "bake-"),
    ),
    "fits": ("fit-",),
    "rendering": ("",),
}
"""Beginnings of names; the first that fits counts."""
STABILITY, SKIPPED = "stability", "skipped"
REPEATS = 1
Rows = dict[str, tuple[Measurement, ...]]


def names_of_shares() -> dict[str, tuple[str, ...]]:
    """Names of the knobs of each share."""
    named: dict[str, list[str]] = {share: [] for share in KNOBS}
    for knob in known_knobs():
        fitting = (share for share, starts in KNOBS.items() if knob.name.startswith(starts))
        named[next(fitting)].append(knob.name)
    return {share: tuple(names) for share, names in named.items()}


def report_shares(folder: Path, skipped: Skipped, quick: bool) -> list[Share]:
    """Everything that the whole report measures."""
    knobs = {knob.name: knob for knob in known_knobs()}
    made = {
        name: Share(
            name=name,
            steps=sum(steps_of(knobs[one], REPEATS) for one in names),
            run=partial(measure_knobs, folder / "error-time" / name, names, quick),
        )
        for name, names in names_of_shares().items()
    }
    made[STABILITY] = Share(
        name=STABILITY,
        steps=len(known_checks(quick=quick)),
        run=partial(measure_stability, folder / STABILITY, quick),
    )
    made[SKIPPED] = Share(name=SKIPPED, steps=INPUTS, run=skipped.measured)
    order = ("video", "scenes", "fill", STABILITY, "fits", SKIPPED, "rendering")
    return [made[name] for name in order]


def measure_knobs(folder: Path, names: Sequence[str], quick: bool, phases: Phases) -> Rows:
    """Rows of some knobs, which stay in ``folder`` for a second call."""
    found = error_time.run(folder, names, REPEATS, phases, quick=quick, keep=True)
    return {result.knob.name: result.rows for result in found.results}


def measure_stability(folder: Path, quick: bool, phases: Phases) -> tuple[Record, ...]:
    """Records that another process can read: a check cannot be run again there."""
    records = stability.run(folder, known_checks(quick=quick), phases).records
    return tuple(replace(one, check=replace(one.check, run=not_again)) for one in records)


def not_again() -> Outcome:
    """Of a check that has run elsewhere."""
    raise NotImplementedError("this check has run in another process")


def joined(rows: Rows) -> tuple[SweepResult, ...]:
    """Results in the order of the knobs."""
    return tuple(
        SweepResult(knob=knob, repeats=repeats_of(knob, REPEATS), rows=rows[knob.name])
        for knob in known_knobs()
        if knob.name in rows
    )

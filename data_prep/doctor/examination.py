"""Examines a few clips of a copy of a data set; a table says what holds and what does not."""

from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff4splat.data.clip import Clip
from diff4splat.data_prep.datasets.common.windows import WindowOptions
from diff4splat.data_prep.datasets.registry import (
    ListedClip,
    clips_of,
    find_dataset,
    list_sequences,
)
from diff4splat.data_prep.doctor.causes import Cause, failed, likely_cause
from diff4splat.data_prep.doctor.comparisons import (
    COMPARISONS,
    Comparison,
    camera_motion,
    measured,
    step_of,
)
from diff4splat.data_prep.doctor.matches import find_matches
from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry import rigid
from diff4splat.progress.phases import Phases

_STANDING = 0.005
"""Way of the camera over the median depth below which wrong cameras hardly show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DoctorJob:
    """What to examine."""

    root: Path
    dataset: str
    clips: int = 3
    """Sequences, spread evenly; of each the middle window."""
    frames: int = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Examined:
    """One clip in the world of its files, and its comparisons."""

    sequence: str
    clip: Clip
    errors: dict[str, float | None]
    cause: Cause | None
    notes: tuple[str, ...] = ()

    @property
    def failed(self) -> list[str]:
        """Names of the comparisons beyond their limits."""
        return failed(self.errors)


@dataclass(frozen=True, slots=True, kw_only=True)
class Unreadable:
    """A sequence that could not be read, and why."""

    sequence: str
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """All that was examined."""

    dataset: str
    listed: int
    """Sequences that are there."""
    examined: tuple[Examined, ...]
    unreadable: tuple[Unreadable, ...]

    @property
    def is_sound(self) -> bool:
        """Whether everything could be read and holds its limits."""
        return bool(self.examined) and not self.unreadable and not self.worst.failed

    @property
    def worst(self) -> Examined:
        """The clip with most failed comparisons."""
        return max(self.examined, key=lambda each: len(each.failed))


def examine(job: DoctorJob, phases: Phases) -> Findings:
    """Read clips and compare everything in them.

    Raises:
        InputError: nothing of the data set is there.
    """
    dataset = find_dataset(job.dataset)
    listed = list_sequences(dataset, job.root)
    count = min(job.clips, len(listed))
    chosen = [listed[round(i * (len(listed) - 1) / max(count - 1, 1))] for i in range(count)]
    options, examined, unreadable = WindowOptions(frames=job.frames), [], []
    with phases.phase("examine", count) as advance:
        for each in chosen:
            try:
                windows = list(clips_of(each, dataset, options))
                examined.append(_examined(each.name, windows[len(windows) // 2]))
            except (FileFormatError, InputError) as error:
                unreadable.append(Unreadable(sequence=each.name, message=str(error)))
            advance()
    return Findings(
        dataset=dataset.facts.title,
        listed=len(listed),
        examined=tuple(examined),
        unreadable=tuple(unreadable),
    )


def _examined(name: str, listed: ListedClip) -> Examined:
    clip = _in_its_world(listed.read(), listed)
    first = clip.views[0]
    matches = find_matches(first, (0, step_of(clip.frames)))
    errors = measured(clip, matches)
    motion = camera_motion(first)
    notes = ("the camera hardly moves: wrong poses would not show",) if motion < _STANDING else ()
    return Examined(
        sequence=name,
        clip=clip,
        errors=errors,
        cause=likely_cause(clip, matches, errors),
        notes=notes,
    )


def _in_its_world(clip: Clip, listed: ListedClip) -> Clip:
    """The clip in the world of its files: inverted poses show only there."""
    window = slice(listed.window.start, listed.window.stop)
    stored = [view.cameras[window] for view in listed.sequence.views[: len(clip.views)]]
    views = tuple(
        replace(view, cameras=view.cameras.with_pose(cameras.world_from_camera))
        for view, cameras in zip(clip.views, stored, strict=True)
    )
    if clip.tracks is None:
        return replace(clip, views=views)
    world_from_first = stored[0].world_from_camera[0]
    flat = clip.tracks.positions.double().reshape(-1, 3)
    moved = rigid.transform_points(world_from_first, flat).reshape(clip.tracks.positions.shape)
    return replace(clip, views=views, tracks=replace(clip.tracks, positions=moved.float()))


def table(findings: Findings) -> str:
    """The comparisons of the worst clip and the median one, limits, verdicts, and likely causes."""
    lines = [
        f"{findings.dataset}: {findings.listed} sequences, {len(findings.examined)} examined",
        "",
        "| compared | worst | median | limit | verdict |",
        "|---|---|---|---|---|",
        *(_row(each, findings.examined) for each in COMPARISONS),
        "",
        *_remarks(findings),
        verdict(findings),
    ]
    return "\n".join(lines)


def _row(comparison: Comparison, examined: tuple[Examined, ...]) -> str:
    values = [each.errors[comparison.name] for each in examined]
    present = torch.tensor([value for value in values if value is not None], dtype=torch.float64)
    limit = with_unit(comparison.limit, comparison)
    if not len(present):
        return f"| {comparison.meaning} | – | – | {limit} | not in these clips |"
    good = float(present.max()) <= comparison.limit
    worst, middle = (with_unit(float(v), comparison) for v in (present.max(), present.median()))
    return f"| {comparison.meaning} | {worst} | {middle} | {limit} | {'ok' if good else 'WRONG'} |"


def with_unit(value: float, comparison: Comparison) -> str:
    """A number with its unit."""
    return f"{value:.2g} {comparison.unit}".strip()


def _remarks(findings: Findings) -> list[str]:
    lines = []
    for each in findings.examined:
        lines += [f"{each.sequence}: {note}" for note in each.notes]
        if each.cause is not None:
            lines.append(f"{each.sequence}: likely cause: {each.cause.text} ({_change(each)})")
    lines += [f"{each.sequence}: not readable: {each.message}" for each in findings.unreadable]
    return lines


def _change(each: Examined) -> str:
    """The failed comparison that the correction mends most, before and after."""
    names = {one.name: one for one in COMPARISONS}
    mended = [name for name in each.failed if each.cause.errors[name] is not None]
    best = min(mended, key=lambda name: each.cause.errors[name] / each.errors[name])
    before, after = (with_unit(e[best], names[best]) for e in (each.errors, each.cause.errors))
    return f"with it undone, {names[best].meaning} falls from {before} to {after}"


def verdict(findings: Findings) -> str:
    """One line that says whether the copy can be trusted."""
    if findings.is_sound:
        return "sound: cameras, depth, flow and tracks agree, as far as the clips have them"
    if not findings.examined:
        return "not readable: no sequence could be examined"
    wrong = findings.worst.failed
    if not wrong:
        return f"{len(findings.unreadable)} sequence(s) not readable; the others are sound"
    names = {one.name: one.meaning for one in COMPARISONS}
    return f"wrong: {'; '.join(names[name] for name in wrong)}"

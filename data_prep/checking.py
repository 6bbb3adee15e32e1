"""Agreement of every clip of a folder with itself, as one table."""

import statistics
from dataclasses import dataclass, fields, replace
from pathlib import Path

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.consistency.check import (
    EXACT,
    MEASURED,
    Consistency,
    Tolerances,
    checked_value,
    consistency_limits,
    require_consistency,
)
from diff4splat.data.consistency.statistics import TrueFraction
from diff4splat.errors import ConfigError, InputError
from diff4splat.progress.phases import Phases

USUAL_SIDE_PX, THIN_SHARE = 128, 0.05
"""At this image side, as many points may lie on leaves and posts thinner than a pixel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Checked:
    """One clip's figures, and what they may be."""

    figures: Consistency
    tolerances: Tolerances


def check_folder(folder: Path, most: int | None, phases: Phases) -> str:
    """A table of each figure beside its limit, and a verdict; ``most`` clips, spread evenly.

    Raises:
        ConfigError: ``most`` is below 1.
        InputError: the folder is empty, or a clip disagrees by more than its kind of truth may.
        FileFormatError: a shard is missing or damaged.
    """
    if most is not None and most < 1:
        raise ConfigError(f"--most: expected at least 1, got {most}; leave it out to look at all")
    clips = ClipFolder(folder)
    if not len(clips):
        raise InputError(f"{folder}: expected clips, got none; prepare some")
    places = clips.spread(most)
    found = []
    with phases.phase("check clips", len(places)) as advance:
        for place in places:
            clip = clips.clip(place)
            tolerances = tolerances_for(clip)
            figures = require_consistency(clip, tolerances)
            found.append(_Checked(figures=figures, tolerances=tolerances))
            advance()
    return _table(found)


def tolerances_for(clip: Clip) -> Tolerances:
    """What the clip's kind of truth may differ by.

    What is thinner than a pixel shows and hides points that no pixel centre sees, and the smaller
    the image, the more is. Visibility itself is tested against every triangle elsewhere.
    """
    if clip.note.metric != "exact":
        return MEASURED
    coarser = max(1.0, USUAL_SIDE_PX / min(clip.size_px))
    return replace(EXACT, visible_share=1 - THIN_SHARE * coarser)


def _table(found: list[_Checked]) -> str:
    header = "| compared | worst clip | limit | median clip | comparisons |"
    names = [field.name for field in fields(Consistency)]
    rows = [_row(name, [one for one in found if getattr(one.figures, name)]) for name in names]
    count = "1 clip holds" if len(found) == 1 else f"all {len(found):,} clips hold"
    return "\n".join(
        [header, "|---|---|---|---|---|", *rows, "", f"consistent: {count} every limit"]
    )


def _row(name: str, clips: list[_Checked]) -> str:
    if not clips:
        return f"| {name} | – | – | – | 0 |"
    values = [checked_value(one.figures, name, one.tolerances) for one in clips]
    limits = [
        limit
        for one in clips
        for check, limit, _ in consistency_limits(one.tolerances)
        if check == name
    ]
    figures = [getattr(one.figures, name) for one in clips]
    count, median = sum(figure.count for figure in figures), statistics.median(values)
    if isinstance(figures[0], TrueFraction):
        return (
            f"| {name} | {min(values):.4f} agree | at least {min(limits):.3g} "
            f"| {median:.4f} agree | {count:,} |"
        )
    return f"| {name} | {max(values):.2e} | at most {max(limits):.3g} | {median:.2e} | {count:,} |"

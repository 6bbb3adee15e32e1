"""Agreement of every clip of a folder with itself, as one table."""

from dataclasses import fields, replace
from pathlib import Path

import torch

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.consistency.statistics import TrueFraction
from diff4splat.data.consistency_check import (
    EXACT,
    MEASURED,
    Consistency,
    Tolerances,
    require_consistency,
)
from diff4splat.errors import ConfigError, InputError
from diff4splat.progress.phases import Phases

USUAL_SIDE_PX, THIN_SHARE = 128, 0.05
"""At this image side, as many points may lie on leaves and posts thinner than a pixel."""


def check_folder(folder: Path, most: int | None, phases: Phases) -> str:
    """The worst figure of each kind over the clips; ``most`` of them, spread evenly.

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
            found.append(require_consistency(clip, tolerances_for(clip)))
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


def _table(found: list[Consistency]) -> str:
    lines = ["| compared | worst of all clips | median clip | comparisons |", "|---|---|---|---|"]
    lines += [
        _row(field.name, [figure for one in found if (figure := getattr(one, field.name))])
        for field in fields(Consistency)
    ]
    return "\n".join(lines)


def _row(name: str, figures: list) -> str:
    if not figures:
        return f"| {name} | – | – | 0 |"
    count = sum(figure.count for figure in figures)
    if isinstance(figures[0], TrueFraction):
        shares = torch.tensor([figure.share for figure in figures])
        return f"| {name} | {shares.min():.4f} agree | {shares.median():.4f} agree | {count:,} |"
    worst = torch.tensor([figure.max for figure in figures])
    middle = torch.tensor([figure.median for figure in figures])
    return f"| {name} | {worst.max():.2e} | {middle.median():.2e} | {count:,} |"

"""Agreement of every clip of a folder with itself, as one table."""

from dataclasses import fields
from pathlib import Path

import torch

from diff4splat.data.agreement import EXACT, MEASURED, Agreement, require_agreement
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.comparing.spread import Share
from diff4splat.errors import ConfigError, InputError
from diff4splat.report.phases import Phases


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
    count = min(len(clips), most or len(clips))
    places = torch.linspace(0, len(clips) - 1, count).round().long().tolist()
    found = []
    with phases.phase("check clips", count) as advance:
        for place in places:
            clip = clips.clip(place)
            tolerances = EXACT if clip.note.metric == "exact" else MEASURED
            found.append(require_agreement(clip, tolerances))
            advance()
    return _table(found)


def _table(found: list[Agreement]) -> str:
    lines = ["| compared | worst of all clips | median clip | comparisons |", "|---|---|---|---|"]
    lines += [
        _row(field.name, [figure for one in found if (figure := getattr(one, field.name))])
        for field in fields(Agreement)
    ]
    return "\n".join(lines)


def _row(name: str, figures: list) -> str:
    if not figures:
        return f"| {name} | – | – | 0 |"
    count = sum(figure.count for figure in figures)
    if isinstance(figures[0], Share):
        shares = torch.tensor([figure.share for figure in figures])
        return f"| {name} | {shares.min():.4f} agree | {shares.median():.4f} agree | {count:,} |"
    worst = torch.tensor([figure.max for figure in figures])
    middle = torch.tensor([figure.median for figure in figures])
    return f"| {name} | {worst.max():.2e} | {middle.median():.2e} | {count:,} |"

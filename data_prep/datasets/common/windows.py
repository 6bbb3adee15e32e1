"""Cuts sequences into windows of a fixed number of frames, and names the clips."""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass

from diff4splat.errors import ConfigError, InputError

_LONGEST = 66
"""Characters of a name before the number of its first frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowOptions:
    """How clips are cut and stored."""

    frames: int = 81
    """Per clip; shorter sequences give one clip of what they have."""
    step: int | None = None
    """Frames from the start of a clip to that of the next; None is ``frames``."""
    fewest_frames: int = 2
    """Fewest frames of a clip."""
    max_side_px: int | None = None
    """Longer images are reduced until their longer side has this length."""
    most_tracks: int = 2048
    """Points per clip; more are thinned out evenly."""
    most_views: int = 8

    def __post_init__(self) -> None:
        for name in ("frames", "most_tracks", "most_views"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: expected at least 1, got {getattr(self, name)}")


def windows(frames: int, options: WindowOptions) -> Iterator[range]:
    """Frames of every clip of a sequence.

    Raises:
        InputError: the sequence is too short for one.
    """
    if frames < options.fewest_frames:
        raise InputError(
            f"expected at least {options.fewest_frames} frames, got {frames}; leave it out"
        )
    length = min(options.frames, frames)
    step = options.step or options.frames
    for first in range(0, frames - length + 1, step):
        yield range(first, first + length)


def clip_identifier(dataset: str, sequence: str, first: int) -> str:
    """A name that shards can hold: short, plain, and different for different sequences."""
    plain = re.sub(r"[^A-Za-z0-9]+", "-", f"{dataset}-{sequence}").strip("-")
    if len(plain) > _LONGEST or plain != f"{dataset}-{sequence}".replace("/", "-"):
        # What was cut or replaced may be all in which two sequences differ.
        digest = hashlib.sha256(sequence.encode(errors="replace")).hexdigest()[:8]
        plain = f"{plain[: _LONGEST - 9].strip('-')}-{digest}"
    return f"{plain}-{first:06d}"

"""What an evaluation measures: clips, judged pictures and points, seeds and intervals.

A protocol is data with a digest. Every number in a report belongs to one digest, so that two
reports can be compared exactly when their digests are equal; a published protocol never changes.
"""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from typing import Literal

from diff4splat.errors import ConfigError

VERSION = 1
"""Of the protocol format that this release reads and writes."""
Task = Literal["generation", "reconstruction", "text"]
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceRange:
    """Which clips: procedural worlds by seed and index, or shards in a folder."""

    kind: Literal["worlds", "shards"]
    split: Literal["training", "held_out"]
    """Of the worlds; held-out worlds are never trained on."""
    folder: str
    """Of the shards, relative to the protocol's file."""
    seed: int
    """Of the worlds."""
    first: int
    """Index of the first clip in the source."""
    count: int
    still_share: float
    """Share of worlds in which nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What is judged in one task."""

    pairs: tuple[Pair, ...]
    """(view, frame) of every judged picture; view 0 is the input view."""
    source_frames: tuple[int, ...]
    """Frames of the input view whose pixels are followed through time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathCheck:
    """Looking at a scene along a path of the path language."""

    path: str
    frames: int
    size_px: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneSearch:
    """Depths that the best-plane baseline may choose from, spaced evenly in log depth."""

    candidates: int
    nearest: float
    """Share of the median depth."""
    farthest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Bootstrap over items."""

    resamples: int
    coverage: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """One fixed way to measure; checked when made."""

    name: str
    source: SourceRange
    frames: int
    views: int
    size_px: tuple[int, int]
    """(height, width)"""
    tracks: int
    generation: Judged
    reconstruction: Judged
    track_frames: tuple[int, ...]
    """When followed points are looked for."""
    still_px: float
    """A Gaussian that never goes farther than this on the input view stands still."""
    loop: PathCheck
    """A closed path: its last picture should be its first one."""
    pose: PathCheck
    """A path to be recovered from its pictures."""
    text_cases: int
    planes: PlaneSearch
    bootstrap: Intervals
    seed: int
    input_stride: int = 1
    """Reconstruction is given every so many-th frame of the input view, from the first on."""

    def __post_init__(self) -> None:
        for what, fine, expected in _rules(self):
            if not fine:
                raise ConfigError(f"protocol {self.name}: expected {expected}, got another {what}")

    @property
    def digest(self) -> str:
        """Sixteen hexadecimal digits that change whenever anything does."""
        text = json.dumps(self.record(), sort_keys=True)
        return hashlib.sha256(f"{VERSION}{text}".encode()).hexdigest()[:16]

    def at_size(self, size_px: tuple[int, int]) -> "Protocol":
        """The same clips and pairs at another picture size, with a name and digest of its own.

        Raises:
            ConfigError: a side is not positive.
        """
        name = f"{self.name} at {size_px[0]} px"
        return replace(self, name=name, size_px=size_px, loop=replace(self.loop, size_px=size_px))

    def record(self) -> dict[str, object]:
        """Plain values, as they are digested and written."""
        values = asdict(self)
        # Protocols were published before there were strides: theirs is 1, and said by leaving it
        # out, so that their files and digests stay what they were.
        if self.input_stride == 1:
            del values["input_stride"]
        return values

    def input_frames(self, task: Task) -> tuple[int, ...]:
        """Frames of the input view that are given; one picture unless a video is reconstructed."""
        if task != "reconstruction":
            return (0,)
        return tuple(range(0, self.frames, self.input_stride))

    def judged(self, task: Task) -> Judged:
        """Pictures and points of a task; text cases are generated."""
        return self.reconstruction if task == "reconstruction" else self.generation

    def items(self, task: Task) -> int:
        """How many items a task has."""
        return self.text_cases if task == "text" else self.source.count


def _rules(protocol: Protocol) -> list[tuple[str, bool, str]]:
    """(what, whether it holds, what was expected)."""
    counts = (protocol.frames, protocol.views, protocol.source.count, *protocol.size_px)
    known = range(protocol.frames)
    planes, checks = protocol.planes, (protocol.loop, protocol.pose)
    return [
        ("count", min(counts) >= 1, "frames, views, sizes and source.count of at least 1"),
        ("name", protocol.name != "", "a name"),
        (
            "source kind",
            protocol.source.kind in ("worlds", "shards"),
            "source.kind worlds or shards",
        ),
        ("source", min(protocol.source.first, protocol.source.seed) >= 0, "source from index 0 on"),
        ("still share", 0 <= protocol.source.still_share <= 1, "source.still_share from 0 to 1"),
        (
            "pair",
            _pairs_fit(protocol),
            f"pairs within {protocol.views} views and frames 0 to "
            f"{protocol.frames - 1}, at least one per task",
        ),
        (
            "frame",
            set(protocol.track_frames) <= set(known),
            f"track_frames below {protocol.frames}",
        ),
        (
            "stride",
            1 <= protocol.input_stride <= protocol.frames,
            f"input_stride from 1 to {protocol.frames}",
        ),
        ("limit", 0 <= protocol.still_px < float("inf"), "still_px of at least 0"),
        ("path", all(check.frames >= 2 for check in checks), "loop and pose of at least 2 frames"),
        (
            "number of cases",
            0 <= protocol.text_cases <= protocol.source.count,
            f"text_cases from 0 to source.count ({protocol.source.count})",
        ),
        (
            "plane",
            planes.candidates >= 1 and 0 < planes.nearest <= planes.farthest,
            "planes with candidates above 0 and 0 < nearest <= farthest",
        ),
        (
            "bootstrap",
            protocol.bootstrap.resamples >= 1 and 0 < protocol.bootstrap.coverage < 1,
            "bootstrap.resamples of at least 1 and coverage between 0 and 1",
        ),
    ]


def _pairs_fit(protocol: Protocol) -> bool:
    for judged in (protocol.generation, protocol.reconstruction):
        views, frames = {v for v, _ in judged.pairs}, {f for _, f in judged.pairs}
        frames |= set(judged.source_frames)
        if not judged.pairs or not views <= set(range(protocol.views)):
            return False
        if not frames <= set(range(protocol.frames)):
            return False
    return True

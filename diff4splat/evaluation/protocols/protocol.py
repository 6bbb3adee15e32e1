"""An evaluation protocol: clips, target images and points, seeds and confidence intervals.

A protocol is data with a digest. Two reports are comparable exactly if their digests are equal, so
a published protocol never changes.
"""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from typing import Literal

from diff4splat.errors import ConfigError

VERSION = 1
"""Version of the protocol format."""
Task = Literal["generation", "reconstruction", "text"]
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceRange:
    """The clips: procedural worlds by seed and index, or shards in a folder."""

    kind: Literal["worlds", "shards"]
    split: Literal["training", "held_out"]
    """Split of the worlds; held-out worlds are never used for training."""
    folder: str
    """Folder of the shards, relative to the protocol file."""
    seed: int
    """Seed of the worlds."""
    first: int
    """Index of the first clip in the source."""
    count: int
    still_share: float
    """Fraction of worlds without object motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """Images and points evaluated in one task."""

    pairs: tuple[Pair, ...]
    """(view, frame) of every target image; view 0 is the input view."""
    source_frames: tuple[int, ...]
    """Frames of the input view whose pixels are tracked through time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathCheck:
    """A camera path, in the path language, along which a scene is rendered."""

    path: str
    frames: int
    size_px: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneSearch:
    """Candidate depths of the best-plane baseline, evenly spaced in log depth."""

    candidates: int
    nearest: float
    """Nearest candidate as a fraction of the median depth; likewise ``farthest``."""
    farthest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Bootstrap intervals over items."""

    resamples: int
    coverage: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """One evaluation protocol, validated on construction."""

    name: str
    source: SourceRange
    frames: int
    views: int
    size_px: tuple[int, int]
    """(height, width)"""
    tracks: int
    generation: Targets
    reconstruction: Targets
    track_frames: tuple[int, ...]
    """Frames at which tracked points are evaluated."""
    still_px: float
    """Largest displacement of a static Gaussian in the input view, in pixels."""
    loop: PathCheck
    """A closed path: its last image should equal its first one."""
    pose: PathCheck
    """A path that is estimated from its rendered images."""
    text_cases: int
    planes: PlaneSearch
    bootstrap: Intervals
    seed: int
    input_stride: int = 1
    """Reconstruction gets every ``input_stride``-th frame of the input view, from the first on."""

    def __post_init__(self) -> None:
        _require_limits(self)
        for what, is_valid, expected in _rules(self):
            if not is_valid:
                raise ConfigError(f"protocol {self.name}: expected {expected}, got another {what}")

    @property
    def digest(self) -> str:
        """Hash of the protocol, in sixteen hexadecimal digits."""
        text = json.dumps(self.record(), sort_keys=True)
        return hashlib.sha256(f"{VERSION}{text}".encode()).hexdigest()[:16]

    def at_size(self, size_px: tuple[int, int]) -> "Protocol":
        """The same clips and pairs at another image size, with another name and digest.

        Raises:
            ConfigError: a side is not positive.
        """
        name = f"{self.name} at {size_px[0]} px"
        return replace(self, name=name, size_px=size_px, loop=replace(self.loop, size_px=size_px))

    def record(self) -> dict[str, object]:
        """Plain values, as hashed and written."""
        values = asdict(self)
        # Protocols published before strides existed have no such key; leaving out the stride 1
        # keeps their files and digests.
        if self.input_stride == 1:
            del values["input_stride"]
        return values

    def input_frames(self, task: Task) -> tuple[int, ...]:
        """Input frames of the input view; the first one only, except for reconstruction."""
        if task != "reconstruction":
            return (0,)
        return tuple(range(0, self.frames, self.input_stride))

    def targets(self, task: Task) -> Targets:
        """Target images and points of a task; text samples use those of generation."""
        return self.reconstruction if task == "reconstruction" else self.generation

    def items(self, task: Task) -> int:
        """Number of items of a task."""
        return self.text_cases if task == "text" else self.source.count


MAX_FRAMES, MAX_VIEWS, MAX_SIDE_PX, MAX_COUNT = 10_000, 100, 16384, 10_000_000
"""More is damage, and would fill the memory before a rule is looked at."""


def _require_limits(protocol: Protocol) -> None:
    sides = (*protocol.size_px, *protocol.loop.size_px, *protocol.pose.size_px)
    frames = (protocol.frames, protocol.input_stride, protocol.loop.frames, protocol.pose.frames)
    counts = (protocol.source.count, protocol.planes.candidates, protocol.bootstrap.resamples)
    limits = {
        "size": (max(sides), MAX_SIDE_PX),
        "number of frames": (max(frames), MAX_FRAMES),
        "number of views": (protocol.views, MAX_VIEWS),
        "count": (max(counts), MAX_COUNT),
    }
    for what, (largest, limit) in limits.items():
        if largest > limit:
            raise ConfigError(
                f"protocol {protocol.name[:60]}: expected a {what} of up to {limit}, got "
                f"{str(largest)[:20]}"
            )


def _rules(protocol: Protocol) -> list[tuple[str, bool, str]]:
    """(what, whether it is valid, what was expected)."""
    counts = (protocol.frames, protocol.views, protocol.source.count, *protocol.size_px)
    frames = range(protocol.frames)
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
            set(protocol.track_frames) <= set(frames),
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
    for targets in (protocol.generation, protocol.reconstruction):
        views, frames = {v for v, _ in targets.pairs}, {f for _, f in targets.pairs}
        frames |= set(targets.source_frames)
        if not targets.pairs or not views <= set(range(protocol.views)):
            return False
        if not frames <= set(range(protocol.frames)):
            return False
    return True

"""A sequence of a data set before it is a clip: cameras in memory, pixels read when asked for.

Axes: ``t`` frames of the sequence, ``h w`` pixels, ``n`` points. Cameras are OpenCV's, in any world
frame, float64; lengths are metres unless the data set has none; pixel centres are at +0.5.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Bool, Float32, Float64, Int32, UInt8
from numpy import ndarray

from diff4splat.data.clip import Metric, TrackSource
from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowMap:
    """Displacement of every pixel to a neighbouring frame."""

    offset_px: Float32[ndarray, "h w 2"]
    """(x, y)"""
    known: Bool[ndarray, "h w"]
    visible: Bool[ndarray, "h w"] | None = None
    """Where the source says so; None leaves it to the flow back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameMaps:
    """One frame of one view; None is what the data set does not have."""

    rgb: UInt8[ndarray, "h w 3"]
    depth: Float32[ndarray, "h w"] | None = None
    """z in metres, 0 where there is none."""
    sky: Bool[ndarray, "h w"] | None = None
    labels: Int32[ndarray, "h w"] | None = None
    """Any number per object, 0 for none; clips number them anew."""
    to_next: FlowMap | None = None
    to_previous: FlowMap | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceView:
    """One camera."""

    cameras: Camera
    """Batch (t,)."""
    read: Callable[[int], FrameMaps]
    """Raises FileFormatError: a file is missing, damaged or of another form; names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointTracks:
    """Tracked points in some frames."""

    positions: Float64[ndarray, "t n 3"]
    """In the world of the cameras; anything where not ``known``."""
    known: Bool[ndarray, "t n"]
    uv: Float64[ndarray, "t n 2"]
    """In the first view."""
    visible: Bool[ndarray, "t n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetFacts:
    """What holds for every clip of a data set."""

    name: str
    """Such as ``spring``; what ``--dataset`` takes."""
    title: str
    license: str
    metric: Metric
    is_static: bool = False
    timed: bool = True
    track_source: TrackSource = "exact"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sequence:
    """Everything but the pixels."""

    scene: str
    views: tuple[SequenceView, ...]
    """The first is the input view."""
    times_s: Float64[ndarray, " t"]
    tracks: Callable[[range], PointTracks] | None = None
    """Points in some frames."""
    caption: str = ""
    license: str = ""
    """Where it is not that of the data set."""

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.times_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedSequence:
    """A sequence that is there; opening it reads its cameras."""

    name: str
    """Unique in the data set, from its path; such as ``abandonedfactory/Easy/P001``."""
    open: Callable[[], Sequence]
    """Raises FileFormatError, InputError: it cannot be used; others may."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """One reader."""

    facts: DatasetFacts
    expected_files: str
    """In words, for messages."""
    sequences: Callable[[Path], Iterator[ListedSequence]]
    """All sequences below a folder, in the order of their names."""

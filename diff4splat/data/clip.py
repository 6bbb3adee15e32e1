"""A clip: one dynamic scene seen by several cameras at the same times, with its truth.

Axes: ``t`` frames, ``h w`` pixels, ``n`` tracked points; views share ``t`` and the times. The world
frame is the first camera of the first view. Lengths are scene units (metres where ``metric`` says
so), depth is z with 0 for "nothing there" (sky, or no truth), flow and ``uv`` are in pixels with
centres at +0.5. Cameras are float64 on disk and here: training casts, geometry checks do not.

What a source does not tell is None, never a guess: no mask does not mean that nothing moves, and no
depth is not depth of 0. ``Clip.motion_truth`` says what is known of motion.
"""

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from diff4splat.data.licenses import commercial_ok
from diff4splat.data.scale_record import ScaleRecord
from diff4splat.geometry.camera import Camera

Metric = Literal["exact", "pseudo", "aligned", "none"]
"""How lengths relate to metres: true, by an assumed base line, fitted, or not at all."""
TrackSource = Literal["exact", "chained", "estimated"]
"""Tracks of a renderer, chained from true flow and depth, or of a tracker."""
MotionTruth = Literal["static", "objects", "tracks", "unknown"]
"""What is known of motion: nothing moves; tracks and masks of objects; tracks alone; nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Where what is seen at each pixel centre goes in the next frame."""

    to_next: Float[Tensor, "s h w 2"]
    """(x, y) in pixels; ``s`` = t − 1. Meaningless where ``known`` is False."""
    known: Bool[Tensor, "s h w"]
    visible: Bool[Tensor, "s h w"]
    """Still seen in the next frame: inside the image and not hidden."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What one camera saw."""

    rgb: UInt8[Tensor, "t h w 3"]
    depth: Float[Tensor, "t h w"] | None
    """None where the source has none."""
    cameras: Camera
    """A batch of shape (t,), float64."""
    sky: Bool[Tensor, "t h w"] | None = None
    """Known to be sky; the other pixels may be it too."""
    moving: Bool[Tensor, "t h w"] | None = None
    """Shows something that moves in the world; all other pixels are static."""
    instances: UInt8[Tensor, "t h w"] | None = None
    """Which object is seen at the pixel centre; 0 is sky or unknown."""
    flow: Flow | None = None
    track_uv: Float[Tensor, "t n 2"] | None = None
    track_visible: Bool[Tensor, "t n"] | None = None
    """In front of the camera, inside the image and not hidden."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """Points that stick to surfaces."""

    positions: Float[Tensor, "t n 3"]
    """World space; meaningless where ``known`` is False."""
    known: Bool[Tensor, "t n"] | None = None
    """Whether the source has the point in this frame; None is always. Visible points are known."""
    instances: UInt8[Tensor, " n"] | None = None
    """Which object of ``View.instances`` the point is on; None where the source does not say."""
    found_at: Int[Tensor, "n 2"]
    """(view, frame) in which the point was chosen at a pixel centre: there it is visible, and its
    depth is that of the depth map. (−1, −1) where the source does not say."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectNote:
    """What a caption may say about one instance."""

    instance: int
    name: str
    """Family, such as ``torus``."""
    color: str
    """Empty for an object of several colours."""
    motion: str
    """Such as ``rolls to the left``; ``""`` is static."""
    object_number: int = 0
    """Instances with the same number are parts of one object; 0 is an object of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipMetadata:
    """Where a clip comes from and what it shows; JSON beside the arrays."""

    identifier: str
    source: str
    """Data set or generator with its version."""
    dataset: str = ""
    """Short name of the data set, such as ``spring``: mixtures and reports count by it."""
    scene: str = ""
    """Clips of one scene (other eyes, cameras, weather) share it: they are no independent data."""
    license: str
    caption: str = ""
    metric: Metric = "none"
    is_static: bool = False
    timed: bool = True
    """False where the source has no frame rate: then ``times_s`` only count the frames."""
    track_source: TrackSource = "exact"
    """Where tracks come from, if there are any."""
    scale: ScaleRecord | None = None
    """How lengths became metres, where they were not given."""
    objects: tuple[ObjectNote, ...] = ()

    @property
    def commercial_ok(self) -> bool:
        """Whether the licence is known to allow commercial use."""
        return commercial_ok(self.license)


@dataclass(frozen=True, slots=True, kw_only=True)
class Clip:
    """Everything known about one scene over ``t`` frames; ``views[0]`` is the input view."""

    note: ClipMetadata
    times_s: Float[Tensor, " t"]
    views: tuple[View, ...]
    tracks: Tracks | None = None

    @property
    def frames(self) -> int:
        """Number of frames of every view."""
        return len(self.times_s)

    @property
    def size_px(self) -> tuple[int, int]:
        """(height, width) of every view."""
        return self.views[0].cameras.size_px

    @property
    def fps(self) -> float | None:
        """Frames per second by the median step; None for one frame, or without a frame rate."""
        if not self.note.timed or self.frames < 2:
            return None
        return 1 / float(self.times_s.diff().median())

    @property
    def motion_truth(self) -> MotionTruth:
        """What the input view can teach about motion; absent masks do not mean stillness."""
        if self.note.is_static:
            return "static"
        if self.tracks is None or self.views[0].track_uv is None:
            return "unknown"
        masked = self.tracks.instances is not None and self.views[0].instances is not None
        return "objects" if masked else "tracks"

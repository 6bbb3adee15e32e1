"""A capture: images of one dynamic scene with known cameras and times, from any reader.

Axes: ``f`` frames (one image of one camera at one time), ``h w`` pixels, ``p`` points. Lengths
are scene units, times seconds, depth is z with 0 for "nothing there". Images are read when asked
for, so that a long capture need not fit into memory.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Where what a frame shows goes to in another frame of the same camera."""

    to_frame: int
    """Index of the other frame in the capture."""
    offset_px: Float[Tensor, "h w 2"]
    """(x, y); meaningless where ``known`` is False."""
    known: Bool[Tensor, "h w"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image and what else is known about its pixels."""

    rgb: Float[Tensor, "h w 3"]
    """RGB in [0, 1], float32; where the file has transparency, over ``Capture.background``."""
    counts: Bool[Tensor, "h w"] | None = None
    """False where the image says nothing about the scene (masked, NaN); None counts all."""
    depth: Float[Tensor, "h w"] | None = None
    """z; 0 where there is none."""
    flow: Flow | None = None


@runtime_checkable
class Frames(Protocol):
    """Images by index; equal calls give equal images."""

    def __len__(self) -> int: ...

    def read(self, index: int) -> Frame:
        """The image of frame ``index``.

        Raises:
            FileFormatError: the file is missing, damaged, or of another size than the camera.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PointCloud:
    """Points to start from, such as those of structure from motion."""

    positions: Float[Tensor, "p 3"]
    rgb: Float[Tensor, "p 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """Everything known about one scene; ``held_out`` frames are never learnt from."""

    name: str
    source: str
    """Format it was read from, such as ``D-NeRF``."""
    cameras: Camera
    """Batch shape (f,), float64."""
    times_s: Float[Tensor, " f"]
    """Float64, finite; they need not be sorted."""
    camera_index: Int[Tensor, " f"]
    """Which camera took the frame; a camera may move."""
    held_out: Bool[Tensor, " f"]
    frames: Frames
    optics: Optics | None = None
    """Of all cameras, where they are more than pinholes."""
    tracks: Mapping[int, PoseTrack] = field(default_factory=dict)
    """Where each camera is at any time, by its index; the others keep the pose of the frame."""
    points: PointCloud | None = None
    background: tuple[float, float, float] | None = None
    """What lies behind the scene where the source says so, such as white for D-NeRF."""
    split_reason: str = ""
    """Who decided what is held out, in words, such as ``transforms_test.json``."""
    license: str = "unknown"
    notes: tuple[str, ...] = ()
    """What the reader changed or left out, in words."""

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def learnt(self) -> Int[Tensor, " m"]:
        """Indices of the frames that are learnt from."""
        return (~self.held_out).nonzero().flatten()

    def physical_camera(self, index: int) -> PhysicalCamera:
        """The camera of one frame with its optics and its way."""
        return PhysicalCamera(
            camera=self.cameras[index],
            optics=Optics() if self.optics is None else self.optics,
            track=self.tracks.get(int(self.camera_index[index])),
        )

    @property
    def time_range_s(self) -> tuple[float, float]:
        """First and last time of all frames."""
        return float(self.times_s.min()), float(self.times_s.max())

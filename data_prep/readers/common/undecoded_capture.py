"""A capture as read from its metadata, before any image is decoded.

Axes: ``f`` frames. Cameras are OpenCV (x right, y down, z forward).
"""

from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import PointCloud
from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.files.depth_file import DepthFile
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.files.video_file import VideoFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One image of one camera at one time."""

    image: ImageFile | VideoFrame
    lens: Intrinsics
    """For the image size in the metadata; scaled to the actual size later."""
    world_from_camera: Float[Tensor, "4 4"]
    time_s: float
    camera: int
    held_out: bool = False
    mask: Path | None = None
    depth: DepthFile | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class UndecodedCapture:
    """A capture with undecoded images."""

    name: str
    source: str
    shots: list[Shot]
    split_reason: str
    shrink: int
    """Downscale factor that remains to be applied."""
    points: PointCloud | None = None
    background: tuple[float, float, float] | None = None
    notes: tuple[str, ...] = ()

"""A camera as it is built: intrinsics and a pose, seen through optics, and maybe on the move.

`Camera` alone is a pinhole. Whoever takes one cannot be handed a fisheye by mistake, because that
is another type.
"""

from dataclasses import dataclass, field, replace

import torch

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.pose_track import PoseTrack


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicalCamera:
    """One camera with its optics; ``track`` says where it is while the image is taken.

    Raises:
        ShapeError: a batch of cameras.
    """

    camera: Camera
    """Focal lengths are pixels per unit of the lens's image plane."""
    optics: Optics = field(default_factory=Optics)
    track: PoseTrack | None = None
    """Where the camera is at any time, in place of the pose; None is a static camera."""

    def __post_init__(self) -> None:
        if self.camera.batch_shape != ():
            raise ShapeError(
                f"PhysicalCamera.camera: expected one camera, got {self.camera.batch_shape}"
            )

    def is_moving_between(self, first_s: float, last_s: float) -> bool:
        """Whether the camera is in more than one place in an interval of time."""
        return self.track is not None and not self.track.is_static_between(first_s, last_s)

    def to(self, target: torch.device | torch.dtype) -> "PhysicalCamera":
        """Move or cast camera and optics; the track stays where it is."""
        return replace(self, camera=self.camera.to(target), optics=self.optics.to(target))

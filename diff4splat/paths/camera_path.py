"""A camera path: cameras with times. Poses are relative to the first camera, which is the identity.

Axes: ``t`` frames. Times are seconds and strictly increase.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPath:
    """Where the camera is at each time."""

    cameras: Camera
    """A batch of shape (t,)."""
    times_s: Float[Tensor, " t"]

    def __post_init__(self) -> None:
        if self.cameras.batch_shape != tuple(self.times_s.shape):
            raise ShapeError(
                f"CameraPath.times_s: expected {self.cameras.batch_shape}, "
                f"got {tuple(self.times_s.shape)}"
            )

    def __len__(self) -> int:
        return len(self.times_s)

    def to(self, target: torch.device | torch.dtype) -> "CameraPath":
        """Move or cast cameras and times."""
        return CameraPath(cameras=self.cameras.to(target), times_s=self.times_s.to(target))


def require_valid_path(path: CameraPath, what: str) -> CameraPath:
    """Return ``path`` when a renderer can follow it.

    Raises:
        InputError: no poses, values that are not finite, no rotation, or times that do not
            increase.
    """
    if len(path) == 0:
        raise InputError(f"{what}: expected at least one camera pose, got none")
    rigid.require_rigid(path.cameras.world_from_camera.detach(), what)
    intrinsics = torch.cat([path.cameras.focal_px, path.cameras.center_px], -1)
    if not bool(torch.isfinite(intrinsics).all() and (path.cameras.focal_px > 0).all()):
        raise InputError(f"{what}: expected finite intrinsics and focal lengths above 0")
    if not bool(torch.isfinite(path.times_s).all() and (path.times_s.diff() > 0).all()):
        raise InputError(f"{what}: expected finite times that increase from frame to frame")
    return path

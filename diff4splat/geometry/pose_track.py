"""A camera's pose at any time between those that are known.

Axes: ``k`` known poses, ``r`` requested times. Positions go in a line and rotations the shorter way
round at constant speed (slerp) from pose to pose; before the first and after the last the camera
is static.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry import quaternion, rigid


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseTrack:
    """Poses at times that increase; both get gradients, as do requested times.

    Raises:
        ShapeError: other numbers of poses and times, or none.
        InputError: times that do not increase, or are not finite.
    """

    times_s: Float[Tensor, " k"]
    world_from_camera: Float[Tensor, "k 4 4"]

    def __post_init__(self) -> None:
        count = len(self.times_s)
        if count == 0 or tuple(self.world_from_camera.shape) != (count, 4, 4):
            raise ShapeError(
                f"PoseTrack.world_from_camera: expected {(max(count, 1), 4, 4)} (from times_s), "
                f"got {tuple(self.world_from_camera.shape)}"
            )
        times_s = self.times_s.detach()
        if not bool(torch.isfinite(times_s).all() and (times_s.diff() > 0).all()):
            raise InputError("PoseTrack.times_s: expected finite times that increase")

    @property
    def is_static(self) -> bool:
        """Whether all poses are the same."""
        poses = self.world_from_camera.detach()
        return bool((poses == poses[0]).all())

    def is_static_between(self, first_s: float, last_s: float) -> bool:
        """Whether the camera is in one place in the whole of an interval."""
        poses, times_s = self.world_from_camera.detach(), self.times_s.detach()
        first = int((times_s <= first_s).sum()) - 1
        last = int((times_s < last_s).sum())
        near = poses[max(first, 0) : last + 1]
        return len(near) < 2 or bool((near == near[0]).all())

    def at(
        self, times_s: Float[Tensor, " r"], dtype: torch.dtype | None = None
    ) -> Float[Tensor, "r 4 4"]:
        """``world_from_camera`` at each time, in ``dtype`` or else that of the times."""
        poses = self.world_from_camera.to(times_s.device, dtype or times_s.dtype)
        if len(poses) == 1:
            return poses.expand(len(times_s), 4, 4)
        keys = self.times_s.to(times_s.device)
        lower = torch.searchsorted(keys.detach().double(), times_s.detach().double(), right=True)
        lower = (lower - 1).clamp(0, len(keys) - 2)
        # Differences of times are small; the times may not be.
        weight = (times_s - keys[lower]) / (keys[lower + 1] - keys[lower])
        weight = weight.clamp(0, 1).to(poses)
        turns = quaternion.from_matrix(poses[:, :3, :3])
        turn = quaternion.slerp(turns[lower], turns[lower + 1], weight)
        places = poses[:, :3, 3]
        place = torch.lerp(places[lower], places[lower + 1], weight[:, None])
        return rigid.from_parts(quaternion.to_matrix(turn), place)

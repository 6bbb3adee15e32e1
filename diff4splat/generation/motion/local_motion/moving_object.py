"""An object that moves about itself: its frame, its displacement, and where its points are.

Axes: ``m`` points, ``y x`` pixels of the copy that the motion prior sees, ``t`` latent frames.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import between
from diff4splat.generation.motion.local_motion.motions import LOCAL_MOTIONS, LocalMotion, Moment
from diff4splat.geometry.camera import Camera

KEYS_PER_PERIOD = 6
"""Key times that a motion to and fro needs."""
MARGIN = 0.3
"""Of an object's larger side: what is farther before or behind it is something else."""
EDGE_QUANTILE = 0.02
"""Pixels beyond it are no part of an object's extent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectFrame:
    """Where an object is, in the axes of the first camera: x right, y down, z away."""

    foot: Float[Tensor, "3"]
    """The middle of its lower end, half way between its front and its back."""
    height: float
    depth_range: tuple[float, float]
    """Along the view, of what the image shows of it."""

    def has(self, points: Float[Tensor, "m 3"]) -> Bool[Tensor, " m"]:
        """Which points are within that range."""
        near, far = self.depth_range
        return (points[:, 2] >= near) & (points[:, 2] <= far)

    def to_local(self, points: Float[Tensor, "m 3"]) -> Float[Tensor, "m 3"]:
        """In units of the height, y up and z to the camera."""
        return (points - self.foot) / self._scale(points)

    def from_local(self, points: Float[Tensor, "m 3"]) -> Float[Tensor, "m 3"]:
        """The inverse."""
        return points * self._scale(points) + self.foot

    def vector(self, offset: Float[Tensor, "3"]) -> Float[Tensor, "3"]:
        """A displacement in the object's frame."""
        return offset / self._scale(offset)

    def _scale(self, like: Tensor) -> Float[Tensor, "3"]:
        return self.height * like.new_tensor([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Of a clip: how long, at how many key times, and the sense of what turns."""

    duration_s: float
    key_times: int
    sense: float

    @property
    def highest_hz(self) -> float:
        """What key times can follow."""
        return (self.key_times - 1) / (KEYS_PER_PERIOD * max(self.duration_s, 1e-6))


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingObject:
    """A connected component of what moves, with a motion about itself."""

    frame: ObjectFrame
    motion: str
    """As in ``LOCAL_MOTIONS``."""
    displacement: Float[Tensor, "t 3"]
    """Of the whole object, linear between latent frames."""
    timing: Timing

    @property
    def local(self) -> LocalMotion:
        """What it does about itself."""
        return LOCAL_MOTIONS[self.motion]

    def positions(self, points: Float[Tensor, "m 3"], progress: float) -> Float[Tensor, "m 3"]:
        """Where ``points`` of the first frame are."""
        moment = self._moment(progress)
        moved = self.local.positions(self.frame.to_local(points), moment)
        return self.frame.from_local(moved) + between(self.displacement, progress)

    def growth(self, progress: float) -> float:
        """Size over that of the first frame."""
        return self.local.growth(self._moment(progress))

    def _moment(self, progress: float) -> Moment:
        return Moment(
            time_s=progress * self.timing.duration_s,
            progress=progress,
            highest_hz=self.timing.highest_hz,
            travel=self.frame.vector(between(self.displacement, progress)),
            sense=self.timing.sense,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingObjects:
    """All of an image, and which pixels are theirs."""

    camera: Camera
    """Of the copy that the motion prior sees."""
    number: Int[Tensor, "y x"]
    """Of the object, from 1; 0 where none with a motion about itself is nearest."""
    objects: tuple[MovingObject, ...]


def object_frame(
    points: Float[Tensor, "y x 3"], inside: Bool[Tensor, "y x"], middle_z: float
) -> ObjectFrame:
    """The frame of the pixels ``inside``; ``middle_z`` is half way between front and back."""
    # As far as the middle, so that the extent is that of the outline.
    at = points / points[..., 2:] * middle_z
    x, y = at[inside][:, :2].unbind(-1)
    left, right = (torch.quantile(x, share) for share in (EDGE_QUANTILE, 1 - EDGE_QUANTILE))
    center = _middle_of_rows(at[..., 0], inside)
    top, bottom = (torch.quantile(y, share) for share in (EDGE_QUANTILE, 1 - EDGE_QUANTILE))
    foot = torch.stack([center, bottom, torch.full_like(bottom, middle_z)])
    near, far = points[inside][:, 2].aminmax()
    margin = MARGIN * float(torch.maximum(right - left, bottom - top))
    return ObjectFrame(
        foot=foot,
        height=max(float(bottom - top), 1e-6 * middle_z),
        depth_range=(float(near) - margin, float(far) + margin),
    )


def _middle_of_rows(x: Float[Tensor, "y x"], inside: Bool[Tensor, "y x"]) -> Float[Tensor, ""]:
    """The axis that most rows are about: what hides a part of them does not shift it."""
    rows = inside.any(1)
    left = torch.where(inside, x, torch.inf).amin(1)[rows]
    right = torch.where(inside, x, -torch.inf).amax(1)[rows]
    return ((left + right) / 2).median()

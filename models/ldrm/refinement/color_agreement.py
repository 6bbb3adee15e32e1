"""How well one depth of the key frames explains the colours of the other frames.

Axes: ``n`` key frames, ``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.refinement.other_frames import (
    OtherFrames,
    blurred_key_frames,
    other_frames,
)
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, flat_cameras

RESIDUAL_SCALE = 0.02
"""Difference of colours above which a pixel counts by half: it is occluded, or moves."""
FAR = 30.0
"""Logarithm of a depth without parallax."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColorAgreement:
    """Key frames beside the other frames that see the same points."""

    rgb: Float[Tensor, "n 3 h w"]
    cameras: Camera
    others: tuple[OtherFrames, ...]
    far_errors: tuple[Float[Tensor, "n h w"], ...]
    """At an infinite distance, for each of ``others``."""

    @classmethod
    def of(cls, video: PosedVideo) -> "ColorAgreement":
        """Of all key frames."""
        rgb, cameras = blurred_key_frames(video), flat_cameras(video.key_cameras)
        others, far = (*other_frames(video),), torch.full_like(rgb[:, 0], FAR)
        errors = (robust_error(rgb, other.colors_at(far, cameras)[0]) for other in others)
        return cls(rgb=rgb, cameras=cameras, others=others, far_errors=(*errors,))

    def error(self, log_depth: Float[Tensor, "n h w"]) -> Float[Tensor, " n"]:
        """Mean of ``robust_error`` over pixels and other frames; 0 without any.

        A point that another frame does not show counts as it would at an infinite distance: to
        leave the frame is no gain.
        """
        total, count = (log_depth.new_zeros(len(log_depth)) for _ in range(2))
        for other, far in zip(self.others, self.far_errors, strict=True):
            rgb, visible = other.colors_at(log_depth, self.cameras)
            error = torch.where(visible, robust_error(rgb, self.rgb), far)
            total = total + error.mean((1, 2)) * other.exists
            count = count + other.exists
        return total / count.clamp_min(1)


def robust_error(
    left: Float[Tensor, "n 3 h w"], right: Float[Tensor, "n 3 h w"]
) -> Float[Tensor, "n h w"]:
    """e² / (e² + RESIDUAL_SCALE²), where e² is the mean squared difference of a pixel's colours."""
    squared = (left - right).square().mean(1)
    return squared / (squared + RESIDUAL_SCALE**2)

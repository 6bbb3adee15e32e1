"""Mean positional gradients of Gaussians, which decide where density control splits.

Axes: ``n`` Gaussians. The gradient of a step is |∂L/∂mean| · z · (image width / 2) / focal length,
with z averaged over the frames of the step. This is the gradient in normalised device coordinates
of Kerbl et al. 2023, computed without a renderer that returns it (3DGRT, arXiv 2407.07090). For
ray tracing it is |∂L/∂mean| · distance · (half the image in radians), with the gradient of the
canonical mean. Both agree near the optical axis.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.view_cone import view_cone


class GradientStatistics:
    """Mean gradient of each Gaussian over the steps in which it is visible."""

    def __init__(self, count: int, dtype: torch.dtype = torch.float32) -> None:
        self.total = torch.zeros(count, dtype=dtype)
        self.visible_steps = torch.zeros_like(self.total)

    def add(self, means: Float[Tensor, "n 3"], ndc_scale: Float[Tensor, " n"]) -> None:
        """Accumulate the gradient of one step at ``means``, converted by ``ndc_scale``."""
        gradient = means.grad
        if gradient is None:
            return
        norm = gradient.norm(dim=-1) * ndc_scale
        self.total += norm
        self.visible_steps += norm > 0

    def reset(self, count: int | None = None) -> None:
        """Start again, for ``count`` Gaussians if their number changed."""
        self.__init__(len(self.total) if count is None else count, self.total.dtype)

    def mean(self) -> Float[Tensor, " n"]:
        """Mean per visible step; 0 for Gaussians that were never visible."""
        return self.total / self.visible_steps.clamp_min(1)


def pinhole_ndc_scale(points: Float[Tensor, "n 3"], cameras: Camera) -> Float[Tensor, " n"]:
    """Scene units per half image width at each point, averaged over pinhole cameras."""
    poses = cameras.world_from_camera.to(points)
    offset = points - poses[:, None, :3, 3]
    z = (offset * poses[:, None, :3, 2]).sum(-1).clamp_min(0).mean(0)
    return z * (0.5 * cameras.size_px[1] / float(cameras.focal_px[:, 0].mean()))


def ndc_scale(
    points: Float[Tensor, "n 3"], cameras: list[PhysicalCamera], time_s: float
) -> Float[Tensor, " n"]:
    """Scene units per half image width at each point, averaged over cameras with any lens.

    The arc of half the image at the distance of the point, as in 3DGRT. Points outside the field
    of view of a camera get 0 from it.
    """
    total = points.new_zeros(len(points))
    for camera in cameras:
        typed = camera.to(points.dtype)
        cone = view_cone(typed, time_s)
        offset = points - cone.position
        distance = offset.norm(dim=-1)
        in_front = offset @ cone.ahead >= min(cone.least_cosine, 0.0) * distance
        half_image_rad = 0.5 * typed.camera.size_px[1] / cone.pixels_per_radian
        total = total + torch.where(in_front, distance * half_image_rad, 0.0)
    return total / len(cameras)

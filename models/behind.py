"""What lies around a picture must not stand before it (ours).

Axes: ``h w`` cells of the input view as networks see it, ``n`` Gaussians. The layer behind the
first picture is coarse, and where it is unsure of its depth it may come to lie before the surface
that the picture shows. From the picture's own camera such a Gaussian hides what is known by what is
guessed. It is pushed along its ray, and grown, until it lies behind.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.scene.gaussians import Gaussians

BEHIND = 1.1
"""Depth over that of the farthest cell of the picture around it."""
AROUND = 11
"""Cells on a side; one of the layer covers four, and its footprint more."""


def behind_picture(
    gaussians: Gaussians, surface: Float[Tensor, "h w"], camera: Camera
) -> Gaussians:
    """The Gaussians, those in view no nearer than ``surface``: depth z as ``camera`` sees it.

    Cells of ``surface`` that are 0 show nothing, and ask for nothing.
    """
    height, width = surface.shape
    farthest = torch.nn.functional.max_pool2d(surface[None, None], AROUND, 1, AROUND // 2)[0, 0]
    pixels, depth = project(camera, gaussians.means)
    column, row = pixels.detach().nan_to_num(-1).floor().clamp(-1, 1 << 20).long().unbind(-1)
    inside = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    least = BEHIND * farthest[row.clamp(0, height - 1), column.clamp(0, width - 1)]
    push = torch.where(inside, least / depth.clamp_min(1e-6), 1.0).clamp_min(1)[:, None]
    center = camera.world_from_camera[:3, 3]
    return replace(
        gaussians,
        means=center + push * (gaussians.means - center),
        scales=push * gaussians.scales,
    )

"""A second, softer layer right behind the image's pixels (ours, ADR 23).

Axes: ``h w`` pixels, ``k`` = WINDOW² of them around each, ``n`` = h w, ``t`` latent frames. Small
Gaussians keep an image sharp but let light through as soon as they part. Behind each pixel
therefore lies a larger one, farther than all pixels near it, so that it is seen through gaps only.
Where the pixel's surface continues it has the pixel's colour and displacement. In front of a depth
edge it belongs to the far side: it has the far side's colour and is static.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.plane_prior import OPAQUE

WINDOW = 7
"""Pixels on a side of the neighbourhood."""
BEHIND = 1.03
"""Depth over that of the farthest pixel in the neighbourhood."""
SAME_SURFACE = 0.15
"""Difference of log depth up to which pixels belong to the far side."""
FOOTPRINT_PX = 0.9
"""Wide enough to close the gaps that open between its own pixels."""
COLOR_SIGMA_PX = 1.0
"""Standard deviation with which near pixels of the far side give their colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FarSide:
    """The far side of every pixel's neighbourhood."""

    depth: Float[Tensor, "h w"]
    shares: Float[Tensor, "k n"]
    """Weight of each neighbour's colour."""
    holds_pixel: Bool[Tensor, "h w"]
    """Whether the pixel itself lies on the far side."""


@torch.no_grad()
def background_layer(
    rgb: Float[Tensor, "h w 3"],
    depth: Float[Tensor, "h w"],
    camera: Camera,
    displacement: Float[Tensor, "t h w 3"] | None = None,
) -> ImageLayer:
    """The layer behind an image of depth z ``depth``, above 0."""
    far = far_side(depth)
    maps = rgb.movedim(-1, 0)
    color = (far.shares * _neighbours(maps)).sum(1)
    color = color / far.shares.sum(0).clamp_min(torch.finfo(depth.dtype).tiny)
    same = far.holds_pixel[..., None]
    pixels = torch.arange(depth.numel(), device=depth.device).view_as(depth)
    return ImageLayer(
        camera=camera,
        rgb=torch.where(same, rgb, color.mT.view_as(rgb)),
        depth=BEHIND * far.depth,
        mask=is_drawable(camera),
        opacity=OPAQUE,
        footprint_px=FOOTPRINT_PX,
        displacement=None if displacement is None else displacement * same,
        pixel_index=torch.where(far.holds_pixel, pixels, NO_PIXEL),
    )


def farther_than_pixels(layer: ImageLayer, farthest: Float[Tensor, "h w"]) -> ImageLayer:
    """The layer with no cell in front of the ``farthest`` depths in its neighbourhood."""
    near = _neighbours(farthest[None])[0].amax(0).view_as(farthest)
    return replace(layer, depth=torch.maximum(layer.depth, BEHIND * near))


def far_side(depth: Float[Tensor, "h w"]) -> FarSide:
    """Depth of the farthest neighbour, and which pixels lie on its surface."""
    near = _neighbours(depth[None])[0]
    farthest = near.amax(0)
    step = torch.arange(WINDOW, device=depth.device, dtype=depth.dtype) - WINDOW // 2
    distance = (step.square()[:, None] + step.square()).flatten()[:, None]
    on_surface = (farthest / near).log() < SAME_SURFACE
    return FarSide(
        depth=farthest.view_as(depth),
        shares=torch.exp(-distance / (2 * COLOR_SIGMA_PX**2)) * on_surface,
        holds_pixel=(farthest.view_as(depth) / depth).log() < SAME_SURFACE,
    )


def _neighbours(maps: Float[Tensor, "c h w"]) -> Float[Tensor, "c k n"]:
    """The pixels around each; those at the border are repeated outwards."""
    padded = torch.nn.functional.pad(maps[None], (WINDOW // 2,) * 4, mode="replicate")
    return torch.nn.functional.unfold(padded, WINDOW)[0].unflatten(0, (len(maps), -1))

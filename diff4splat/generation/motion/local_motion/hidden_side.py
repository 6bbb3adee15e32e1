"""The side of an object that the image hides, which comes to the front as it turns (ours, ADR 47).

Axes: ``h w`` pixels of the image, ``m`` new Gaussians. The back mirrors the front at the object's
middle. It is as wide as the front, so it is seen under a smaller angle: the front hides it in the
input view, and the object keeps its size as it turns. Where the front falls back from a pixel to
the next, and at the outline, cells along the ray close the surface.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import max_pool2d

from diff4splat.generation.layered_image.disoccluded.static_layer import FOOTPRINT_PX
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.mask_rim import nearest_inside
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.depth import unproject
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

RIM_PX = 2
"""The outermost pixels have no other side: their colours are mixed with the background, and from
behind them cells would show in the input view."""
WALL_FOOTPRINT_PX = 0.4
"""Narrow, so that cells do not show beside the next pixel, which may be farther."""
MAX_STEPS = 64
"""Cells along a ray, at most."""


def hidden_side(
    pixels: ImageLayer, inside: Bool[Tensor, "h w"], middle_z: float, colors: Float[Tensor, "h w 3"]
) -> Gaussians:
    """Back and outline of the object ``inside``, at rest; empty of one that is nothing but rim."""
    core = ~grown(~inside, RIM_PX)
    z, row = _depths(pixels, core, middle_z)
    rays = unproject(pixels.camera, torch.ones_like(pixels.depth))[core]
    footprint_px = torch.full_like(z, WALL_FOOTPRINT_PX)
    footprint_px[: len(rays)] = FOOTPRINT_PX
    of_front = torch.minimum(z, 2 * middle_z - z)
    scale = footprint_px * of_front / pixels.camera.focal_px[0]
    center = rays.mean(0)
    means = center * z[:, None] + (rays[row] - center) * of_front[:, None]
    return _isotropic(means, scale, colors[core][row])


def interior_colors(
    pixels: ImageLayer, inside: Bool[Tensor, "h w"], mixed_px: int
) -> Float[Tensor, "h w 3"]:
    """Of the nearest pixel ``mixed_px`` from the outline; the image's own where there is none."""
    pure = ~grown(~inside, mixed_px)
    if not bool(pure.any()):
        return pixels.rgb
    return pixels.rgb.flatten(0, 1)[nearest_inside(pure)]


def _depths(
    pixels: ImageLayer, core: Bool[Tensor, "h w"], middle_z: float
) -> tuple[Float[Tensor, " m"], Int[Tensor, " m"]]:
    """Of new cells, and the row of the pixel of ``core`` on whose ray each lies."""
    depth = torch.where(core, pixels.depth, middle_z).clamp_max(middle_z)
    spacing = depth / pixels.camera.focal_px[0]
    falls = max_pool2d(depth[None], 3, 1, 1)[0] - depth
    count = (falls / spacing)[core].long().clamp_max(MAX_STEPS)
    rows = torch.arange(len(count), device=count.device)
    along = torch.repeat_interleave(rows, count)
    step = torch.arange(len(along), device=count.device) - (count.cumsum(0) - count)[along] + 1
    front = depth[core]
    wall = front[along] + step * spacing[core][along]
    z = torch.cat([2 * middle_z - front, wall, 2 * middle_z - wall])
    return z, torch.cat([rows, along, along])


def _isotropic(
    means: Float[Tensor, "m 3"], scale: Float[Tensor, " m"], rgb: Float[Tensor, "m 3"]
) -> Gaussians:
    identity = means.new_tensor([1.0, 0.0, 0.0, 0.0])
    return Gaussians(
        means=means,
        quats=identity.expand(len(means), 4).clone(),
        scales=scale[:, None].expand(-1, 3).clone(),
        opacities=torch.full_like(scale, OPAQUE),
        sh=dc_from_color(rgb)[:, None],
    )

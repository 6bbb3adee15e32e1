"""Pixels of mixed colour at the edge of what moves go along with it (ours, ADR 25).

Axes: ``h w`` pixels, ``t`` latent frames. The mask belongs to a smaller copy, so a pixel of the
image beside it may show a bit of the object. Left behind, such pixels draw its outline. JPEG has
half as many pixels of chroma, so beside an object grass may have its tint and yet be dark as grass.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.mask_rim import RIM_PX, likeness, nearest_inside
from diff4splat.generation.layered_image.types import moving_mask

LEAST_LIKENESS = 0.25
"""Place of a colour between that of the background, 0, and of the object, 1."""


def with_moving_rim(
    depth: Float[Tensor, "h w"], displacement: Float[Tensor, "t h w 3"], rgb: Float[Tensor, "h w 3"]
) -> tuple[Float[Tensor, "h w"], Float[Tensor, "t h w 3"]]:
    """Both maps, in which mixed pixels have those of the nearest pixel that moves."""
    moving = moving_mask(depth, displacement)
    if not bool(moving.any()) or bool(moving.all()):
        return depth, displacement
    beside = grown(moving, RIM_PX) & ~moving
    chroma = rgb - rgb.mean(-1, keepdim=True)
    alike = [likeness(moving, beside, colors) for colors in (rgb, chroma)]
    joins = beside & (torch.maximum(*alike) > LEAST_LIKENESS)
    own = torch.arange(depth.numel(), device=depth.device).view_as(depth)
    source = torch.where(joins, nearest_inside(moving), own)
    return depth.flatten()[source], displacement.flatten(1, 2)[:, source]

"""A static layer of the image's pixels: what is known around a hole goes on in it (ours, ADR 28).

Axes: ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.even_extension import extended_evenly
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

FOOTPRINT_PX = 0.5
"""Standard deviation of a cell's Gaussian: without gaps between neighbours."""


def static_layer(
    pixels: ImageLayer,
    known: Bool[Tensor, "h w"],
    mask: Bool[Tensor, "h w"],
    covering_depth: Float[Tensor, "h w"],
    rgb: Float[Tensor, "h w 3"],
) -> ImageLayer:
    """Cells where ``mask`` is true, behind ``covering_depth``; something must be ``known``.

    Inverse depth of the known pixels is extended evenly; ``rgb`` are the cells' colours.
    """
    depth = 1 / extended_evenly(1 / pixels.depth, known)
    return replace(
        pixels,
        rgb=rgb,
        depth=torch.maximum(depth, BEHIND * covering_depth),
        mask=mask & is_drawable(pixels.camera),
        footprint_px=FOOTPRINT_PX,
        displacement=None,
        pixel_index=torch.full_like(known, NO_PIXEL, dtype=torch.long),
        in_image=False,
    )

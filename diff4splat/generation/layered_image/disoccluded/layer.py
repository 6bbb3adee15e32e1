"""What a moving object disoccludes, at the size of the image: static cells behind it (ours).

    pixels ─ what moves ─┬─ inverse depth of the static pixels around it, extended evenly
                         └─ their colours, likewise, with the fine detail of shifted patches

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, which blurs
every texture. Patches keep it.
"""

import math
from dataclasses import replace

import torch

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.even_extension import extended_evenly
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

MARGIN_SHARE = 1 / 48
"""Of the image's longer side: near what moves, colours are mixed and shadows fall."""
FOOTPRINT_PX = 0.5
"""Standard deviation of a cell's Gaussian: without gaps between neighbours."""


@torch.no_grad()
def disoccluded_layer(pixels: ImageLayer) -> ImageLayer | None:
    """The layer behind what moves of ``pixels``; None where nothing or almost everything does."""
    if pixels.displacement is None:
        return None
    moving = pixels.displacement.any(-1).any(0)
    margin_px = math.ceil(MARGIN_SHARE * max(moving.shape))
    known = ~grown(moving, margin_px)
    if not bool(moving.any()) or not bool(known.any()):
        return None
    depth = 1 / extended_evenly(1 / pixels.depth, known)
    return replace(
        pixels,
        rgb=textured(pixels.rgb, known),
        depth=torch.maximum(depth, BEHIND * pixels.depth),
        mask=grown(moving, 1) & is_drawable(pixels.camera),
        footprint_px=FOOTPRINT_PX,
        displacement=None,
        pixel_index=torch.full_like(pixels.pixel_index, NO_PIXEL),
        in_image=False,
    )

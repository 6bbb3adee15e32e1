"""What a moving object disoccludes, at the size of the image: static cells behind it (ours).

    pixels ─ what moves ─┬─ inverse depth of the static pixels around it, extended evenly
                         └─ their colours, likewise, with the fine detail of shifted patches

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, which blurs
every texture. Patches keep it.
"""

import math

import torch

from diff4splat.generation.layered_image.disoccluded.static_layer import static_layer
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import ImageLayer, moving_mask

MARGIN_SHARE = 1 / 48
"""Of the image's longer side: near what moves, colours are mixed and shadows fall."""


@torch.no_grad()
def disoccluded_layer(pixels: ImageLayer) -> ImageLayer | None:
    """The layer behind what moves of ``pixels``; None where nothing or almost everything does."""
    moving = moving_mask(pixels.depth, pixels.displacement)
    margin_px = math.ceil(MARGIN_SHARE * max(moving.shape))
    known = ~grown(moving, margin_px)
    if not bool(moving.any()) or not bool(known.any()):
        return None
    return static_layer(pixels, known, grown(moving, 1), pixels.depth)

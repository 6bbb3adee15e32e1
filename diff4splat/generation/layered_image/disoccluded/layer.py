"""What a moving object disoccludes, at the size of the image: static cells behind it (ours).

    pixels ─ what moves ─┬─ inverse depth of the static pixels around it, extended evenly
                         └─ their colours, likewise, with the fine detail of shifted patches,
                            or inpainted by a network

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, which blurs
every texture. Patches and the network keep it.
"""

import math

import torch

from diff4splat.generation.layered_image.disoccluded.static_layer import static_layer
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.types import ImageLayer, moving_mask
from diff4splat.generation.layered_image.windows import largest_around

MARGIN_SHARE = 1 / 48
"""Of the image's longer side: near what moves, colours are mixed and shadows fall."""


@torch.no_grad()
def disoccluded_layer(pixels: ImageLayer, inpaint: Inpaint = textured) -> ImageLayer | None:
    """The layer behind what moves of ``pixels``; None where nothing or almost everything does."""
    moving = moving_mask(pixels.depth, pixels.displacement)
    margin_px = math.ceil(MARGIN_SHARE * max(moving.shape))
    known = ~grown(moving, margin_px)
    if not bool(moving.any()) or not bool(known.any()):
        return None
    # A footprint covers the neighbours too: a cell behind its own pixel alone would be in front of
    # a farther pixel of the object beside it, and stay there as a part of the object moves.
    farthest = largest_around(torch.where(moving, pixels.depth, 0.0), 1)
    covering = torch.maximum(pixels.depth, farthest)
    rgb = inpaint(pixels.rgb, known)
    return static_layer(pixels, known, grown(moving, 1), covering, rgb)

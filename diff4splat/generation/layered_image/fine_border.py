"""A fine layer beside the border of an image: what a small camera motion brings into view (ours).

    pixels, or the static layer behind what moves ─ smaller copy ─┬─ colours of its border, mixed
                                                                  └─ depth of the nearest pixel

Axes: ``h w`` pixels, ``hs ws`` cells of the copy with a margin on every side. The border extension
has cells of 4 pixels of a smaller copy and reaches farther; this layer lies before it.
"""

import math

import torch
from torch.nn.functional import avg_pool2d, pad

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.border_colors import continue_colors
from diff4splat.generation.layered_image.border_extension import extended_camera
from diff4splat.generation.layered_image.disoccluded.texture import with_detail
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.models.ldrm.refinement.heads import replicate_border

MAX_SIDE = 256
"""Cells along the longer side of an image: more cost bytes and show no more."""
MARGIN_SHARE = 1 / 8
"""Of the longer side; twice as much is no better on worlds with the usual camera paths."""
FOOTPRINT_CELLS = 0.5


@torch.no_grad()
def fine_border(
    pixels: ImageLayer, disoccluded: ImageLayer | None, texture: bool = False
) -> ImageLayer:
    """The static layer around ``pixels``; ``disoccluded`` is the one behind what moves of them.

    With ``texture`` its colours have the fine detail of the image, which photographs need to look
    whole. In small images that costs 1.3 dB out of the frame, for which a mean is best.
    """
    source = pixels if disoccluded is None else disoccluded
    step = _cell_px(pixels.camera.size_px)
    maps = torch.cat([source.rgb, (1 / source.depth)[..., None]], -1)
    cells = avg_pool2d(maps.movedim(-1, 0)[None], step)
    margin = math.ceil(MARGIN_SHARE * max(cells.shape[2:]))
    camera = extended_camera(pixels.camera, margin, step)
    outside = pad(torch.zeros_like(cells[0, 0]), (margin,) * 4, value=1.0) > 0
    rgb = continue_colors(cells[0, :3].movedim(0, -1), margin)
    if texture:
        rgb = with_detail(rgb, ~outside, rgb)
    return ImageLayer(
        camera=camera,
        rgb=rgb,
        depth=BEHIND / replicate_border(cells[:, 3:], margin)[0, 0],
        mask=outside & is_drawable(camera),
        opacity=OPAQUE,
        footprint_px=FOOTPRINT_CELLS,
    )


def _cell_px(size_px: tuple[int, int]) -> int:
    """The least side of a cell that divides the image and leaves no more cells than allowed."""
    common = math.gcd(*size_px)
    fitting = (side for side in range(1, common) if common % side == 0)
    return next((side for side in fitting if max(size_px) <= side * MAX_SIDE), common)

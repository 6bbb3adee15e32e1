"""Coarse layers behind the figures of a photograph have the ground's colours (ours, ADR 52).

Axes: ``h w`` cells of a layer, ``y x`` cells of about that size on the image. The background layer
and the border extension continue the image backwards, with the colours of what is in front. Beside
a figure's outline they lie as far as the ground, since no cell may hide a pixel, and come into view
as blots in the figure's colours.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import interpolate

from diff4splat.generation.layered_image.other_grid import on_grid
from diff4splat.generation.layered_image.types import ImageLayer, moving_mask

GROUND_SHARE = 0.9
"""Of the way from a figure to the ground behind it, in log depth: cells that close gaps of the
figure lie before it."""
INPAINTED_SHARE = 0.5
"""The same where a network inpaints the ground: its colours are good enough for cells that lie
between both, as do some beside an outline."""
LEAST_DISTANCE = 0.3
"""Of log depth between both: a floor that ends at the sky has cells of its own behind it."""


def with_ground_colors(
    layer: ImageLayer, pixels: ImageLayer, ground: ImageLayer, share: float = GROUND_SHARE
) -> ImageLayer:
    """Static cells at ``share`` of the way from ``pixels`` to ``ground`` take its colours."""
    cell_px = float((pixels.camera.focal_px / layer.camera.focal_px).mean())
    depths = torch.stack([ground.depth, pixels.depth]).log()
    maps = _reduced(torch.cat([ground.rgb.movedim(-1, 0), depths]), cell_px)
    size = (maps.shape[1], maps.shape[2])
    found, inside = on_grid(maps, pixels.camera.resized(size), layer.camera)
    of_ground, of_pixels = found[3:]
    distance = of_ground - of_pixels
    far = (layer.depth.log() > of_pixels + share * distance) & (distance > LEAST_DISTANCE)
    static = ~moving_mask(layer.depth, layer.displacement)
    takes = (inside & far & static)[..., None]
    return replace(layer, rgb=torch.where(takes, found[:3].movedim(0, -1), layer.rgb))


def _reduced(maps: Float[Tensor, "c h w"], cell_px: float) -> Float[Tensor, "c y x"]:
    """Means over cells."""
    size = tuple(max(round(side / cell_px), 1) for side in maps.shape[1:])
    return interpolate(maps[None], size, mode="area")[0]

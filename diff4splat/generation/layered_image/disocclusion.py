"""Colours of what a moving object disoccludes: inpainting of the layers behind it (ours, ADR 23).

Axes: ``h w`` pixels of the smaller copy that the networks see. The extended layers continue the
image backwards, so behind an object they have the object's colours, which would stay when it moves
away. There they take the colours of the static pixels around it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.generation.layered_image.windows import largest_around
from diff4splat.models.blocks.conv_block import CELL_PX

GROWN_PX = 2
"""Around a moving object its colours are mixed with those of the static pixels."""


def inpaint_background(
    layer: ImageLayer, rgb: Float[Tensor, "h w 3"], moving: Bool[Tensor, "h w"]
) -> ImageLayer:
    """The background layer with new colours where it is static behind something moving."""
    static = ~grown(moving)
    if not _inpaints(static):
        return layer
    behind = ~static & (layer.pixel_index == NO_PIXEL)
    colors = fill_from_neighbours(rgb, static)
    return replace(layer, rgb=torch.where(behind[..., None], colors, layer.rgb))


def inpaint_border(
    layer: ImageLayer, rgb: Float[Tensor, "h w 3"], moving: Bool[Tensor, "h w"]
) -> ImageLayer:
    """The same for the cells of the border extension, at the pixel in the middle of each."""
    static = ~grown(moving)
    if not _inpaints(static):
        return layer
    half, inner = slice(CELL_PX // 2, None, CELL_PX), _inner(layer, rgb.shape[:2])
    colors = layer.rgb.clone()
    fresh = fill_from_neighbours(rgb, static)[half, half]
    colors[inner] = torch.where(static[half, half][..., None], colors[inner], fresh)
    return replace(layer, rgb=colors)


def without_disoccluded(layer: ImageLayer, moving: Bool[Tensor, "h w"]) -> ImageLayer:
    """The layer without its static cells behind what moves, which would hide an disoccluded layer.

    The border extension has cells of 4 pixels; those whose middle moves are left out.
    """
    if layer.depth.shape == moving.shape:
        behind = (
            moving if layer.displacement is None else moving & ~layer.displacement.any(-1).any(0)
        )
        return replace(layer, mask=layer.mask & ~behind)
    half = slice(CELL_PX // 2, None, CELL_PX)
    mask = layer.mask.clone()
    inner = _inner(layer, moving.shape)
    mask[inner] &= ~moving[half, half]
    return replace(layer, mask=mask)


def _inner(layer: ImageLayer, size_px: torch.Size) -> tuple[slice, slice]:
    """Cells of a border extension that lie on the image."""
    sides = [side // CELL_PX for side in size_px]
    first = [(whole - side) // 2 for whole, side in zip(layer.mask.shape, sides, strict=True)]
    return tuple(slice(start, start + side) for start, side in zip(first, sides, strict=True))


def fill_from_neighbours(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """``rgb`` where it is ``known``, at least somewhere; else the mean of the smallest window."""
    share = known.to(rgb)[None]
    maps = torch.cat([rgb.movedim(-1, 0) * share, share])[None]
    filled, have, side = rgb, known, 3
    while not bool(have.all()):
        mean = torch.nn.functional.avg_pool2d(maps, side, 1, side // 2, count_include_pad=False)[0]
        fresh = (mean[3] > 0) & ~have
        color = (mean[:3] / mean[3].where(fresh, 1)).movedim(0, -1)
        filled, have = torch.where(fresh[..., None], color, filled), have | fresh
        side = 2 * side + 1
    return filled


def grown(mask: Bool[Tensor, "h w"], margin_px: int = GROWN_PX) -> Bool[Tensor, "h w"]:
    """The mask with a margin around it."""
    return largest_around(mask.float(), margin_px) > 0


def _inpaints(static: Bool[Tensor, "h w"]) -> bool:
    """Something moves, and something else does not."""
    return bool(static.any()) and not bool(static.all())

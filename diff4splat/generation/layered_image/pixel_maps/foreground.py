"""The foreground grown at depth edges, over the pixels of mixed colour (ours, ADR 31).

Axes: ``h w`` pixels, ``t`` latent frames. A pixel on an edge shows a bit of both sides. Left on the
far side it stays behind as an outline when the camera moves.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.types import DEPTH_STEP, moving_mask


def grow_foreground(
    depth: Float[Tensor, "h w"], displacement: Float[Tensor, "t h w 3"] | None, cell_px: int
) -> tuple[Float[Tensor, "h w"], Float[Tensor, "t h w 3"] | None]:
    """Both maps with the foreground grown by a pixel; depth is above 0.

    Within what moves it grows by a cell of the depth map, in which edges lie there. What moves has
    its rim already: only moving pixels join it, and they join nothing else.
    """
    # Pixels join those that move alike, so growing changes nothing of it.
    moving = moving_mask(depth, displacement)
    growing = torch.ones_like(moving)
    for _ in range(cell_px):
        source = foreground_source(depth, moving, growing)
        depth = depth.flatten()[source]
        if displacement is not None:
            displacement = displacement.flatten(1, 2)[:, source]
        growing = moving
    return depth, displacement


def foreground_source(
    depth: Float[Tensor, "h w"], moving: Bool[Tensor, "h w"], growing: Bool[Tensor, "h w"]
) -> Int[Tensor, "h w"]:
    """Flat index of the pixel whose surface each pixel belongs to: a neighbour's or its own.

    Only ``growing`` pixels join a neighbour.
    """
    log_depth = depth.log()
    own = torch.arange(depth.numel(), device=depth.device).view_as(depth)
    near = _with_neighbours(log_depth, torch.inf)
    nearest = near.min(0)
    pixels = _with_neighbours(own, 0.0).gather(0, nearest.indices[None])[0]
    joins = log_depth - nearest.values > DEPTH_STEP
    joins &= growing & (moving == moving.flatten()[pixels])
    return torch.where(joins, pixels, own)


def _with_neighbours(values: Tensor, outside: float) -> Tensor:
    """A map, and its values above, below, to the left and to the right."""
    padded = torch.nn.functional.pad(values, (1, 1, 1, 1), value=outside)
    inner, first, last = slice(1, -1), slice(None, -2), slice(2, None)
    places = ((inner, inner), (first, inner), (last, inner), (inner, first), (inner, last))
    return torch.stack([padded[place] for place in places])

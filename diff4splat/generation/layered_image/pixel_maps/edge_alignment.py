"""Depth edges on the edges of colour beside them (ours, ADR 33).

Axes: ``h w`` pixels. Edges of a predicted map are as wide as its cells and lie up to a cell beside
those of the image: pixels of the foreground stay behind when the camera moves, and pixels of the
background come along. Each pixel beside an edge takes the depth of the side whose mean colour it is
more like, where colours decide.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import avg_pool2d

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.pixel_maps.edge_sides import REACH_CELLS, both_sides
from diff4splat.generation.layered_image.types import DEPTH_STEP, moving_mask
from diff4splat.generation.layered_image.windows import largest_around, smallest_around

SHARPNESS = 0.7
"""Of the whole difference around an edge, the share that lies close to it; a slope has less."""
CLOSE_CELLS = 2 / 3
"""Radius in which an edge lies; it is compared in ``REACH_CELLS``."""
NEAR_SHARE = 0.25
"""Of the near side's colour from which a pixel is near: mixed pixels belong to the foreground."""


def align_static_edges(
    depth: Float[Tensor, "h w"],
    displacement: Float[Tensor, "t h w 3"] | None,
    rgb: Float[Tensor, "h w 3"],
    cell_px: int,
) -> Float[Tensor, "h w"]:
    """``align_edges`` away from what moves, whose mask decides what belongs to it."""
    moving = grown(moving_mask(depth, displacement), REACH_CELLS * cell_px)
    return torch.where(moving, depth, align_edges(depth, rgb, cell_px))


@torch.no_grad()
def align_edges(
    depth: Float[Tensor, "h w"], rgb: Float[Tensor, "h w 3"], cell_px: int
) -> Float[Tensor, "h w"]:
    """Depth above 0, predicted in cells of ``cell_px`` pixels, with edges where colour has them."""
    log_depth = depth.log()
    rows, columns = beside_edges(log_depth, cell_px).nonzero().unbind(-1)
    if not len(rows):
        return depth
    aligned = depth.clone()
    share = torch.full_like(depth, torch.nan)
    sides = both_sides(log_depth, rgb, (rows, columns), cell_px)
    share[rows, columns] = sides.near_share
    is_near = _with_neighbours(share)[rows, columns] > NEAR_SHARE
    chosen = torch.where(is_near, sides.near, sides.far).exp()
    decided = ~sides.near_share.isnan()
    aligned[rows, columns] = torch.where(decided, chosen, depth[rows, columns])
    return aligned


def beside_edges(log_depth: Float[Tensor, "h w"], cell_px: int) -> Bool[Tensor, "h w"]:
    """Pixels within a cell of a step; a slope of the same height is none."""
    close_px, reach_px = math.ceil(CLOSE_CELLS * cell_px), REACH_CELLS * cell_px
    step = _range(log_depth, close_px)
    edge = (step > DEPTH_STEP) & (step > SHARPNESS * _range(log_depth, reach_px))
    return grown(edge, close_px)


def _with_neighbours(share: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """The mean of a value and those around it; NaN counts as absent."""
    known = ~share.isnan()
    planes = torch.stack([share.where(known, 0.0), known.to(share)])[None]
    sums = avg_pool2d(planes, 3, 1, 1)[0]
    return (share + sums[0] / sums[1].clamp_min(torch.finfo(share.dtype).tiny)) / 2


def _range(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    """Largest minus smallest value around each pixel."""
    return largest_around(values, radius_px) - smallest_around(values, radius_px)

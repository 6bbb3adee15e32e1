"""Depth edges on the edges of colour beside them (ours, ADR 33).

Axes: ``h w`` pixels, ``n`` pixels beside an edge, ``k`` pixels of the disc around each. Edges of a
predicted map are as wide as its cells and lie up to a cell beside those of the image: pixels of the
foreground stay behind when the camera moves, and pixels of the background come along. Each pixel
beside an edge takes the depth of the side whose mean colour it is more like, where colours tell.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d, pad

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import moving_mask

DEPTH_STEP = 0.06
"""Difference of log depth that makes an edge."""
SHARPNESS = 0.7
"""Of the whole difference around an edge, the share that lies close to it; a slope has less."""
REACH_CELLS, CLOSE_CELLS = 2, 2 / 3
"""Radius around an edge in which it is compared, and in which it lies."""
SIDE_SHARE = 0.25
"""Of the range of log depth around a pixel: what belongs to the nearer side, and to the farther."""
CONTRAST, LEAST_CONTRAST = 0.75, 0.06
"""Colours tell if those of both sides differ by so many standard deviations, and that much more."""
NEAR_SHARE = 0.25
"""Of the near side's colour from which a pixel is near: mixed pixels belong to the foreground."""
CHUNK = 20_000
"""Pixels at a time, for memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """What is on either side of the edge beside each pixel."""

    near: Float[Tensor, " n"]
    """Log depth."""
    far: Float[Tensor, " n"]
    near_share: Float[Tensor, " n"]
    """0 with the colour of the far side, 1 with that of the near one; NaN where colours do not
    tell."""


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
    sides = _both_sides(log_depth, rgb, (rows, columns), cell_px)
    share[rows, columns] = sides.near_share
    is_near = _with_neighbours(share)[rows, columns] > NEAR_SHARE
    chosen = torch.where(is_near, sides.near, sides.far).exp()
    tells = ~sides.near_share.isnan()
    aligned[rows, columns] = torch.where(tells, chosen, depth[rows, columns])
    return aligned


def beside_edges(log_depth: Float[Tensor, "h w"], cell_px: int) -> Bool[Tensor, "h w"]:
    """Pixels within a cell of a step; a slope of the same height is none."""
    close_px, reach_px = math.ceil(CLOSE_CELLS * cell_px), REACH_CELLS * cell_px
    step = _range(log_depth, close_px)
    edge = (step > DEPTH_STEP) & (step > SHARPNESS * _range(log_depth, reach_px))
    return _largest(edge.to(log_depth), close_px) > 0


def _both_sides(
    log_depth: Float[Tensor, "h w"],
    rgb: Float[Tensor, "h w 3"],
    pixels: tuple[Int[Tensor, " n"], Int[Tensor, " n"]],
    cell_px: int,
) -> Sides:
    """The two sides of the edge beside every pixel."""
    parts = []
    for rows, columns in zip(*(axis.split(CHUNK) for axis in pixels), strict=True):
        near = _disc(log_depth.shape, (rows, columns), cell_px)
        parts.append(_sides(log_depth[near], rgb[near], rgb[rows, columns]))
    names = ("near", "far", "near_share")
    return Sides(**{name: torch.cat([getattr(part, name) for part in parts]) for name in names})


def _sides(
    log_depth: Float[Tensor, "n k"], rgb: Float[Tensor, "n k 3"], own: Float[Tensor, "n 3"]
) -> Sides:
    """From the discs around pixels of colours ``own``."""
    nearest, farthest = log_depth.amin(1, keepdim=True), log_depth.amax(1, keepdim=True)
    place = (log_depth - nearest) / (farthest - nearest).clamp_min(torch.finfo(rgb.dtype).tiny)
    near, near_rgb, near_spread = _means(place < SIDE_SHARE, log_depth, rgb)
    far, far_rgb, far_spread = _means(place > 1 - SIDE_SHARE, log_depth, rgb)
    difference = near_rgb - far_rgb
    contrast = difference.norm(dim=-1)
    share = ((own - far_rgb) * difference).sum(-1) / contrast.square()
    tells = contrast > CONTRAST * (near_spread + far_spread) + LEAST_CONTRAST
    return Sides(near=near, far=far, near_share=share.clamp(0, 1).where(tells, torch.nan))


def _means(
    chosen: Bool[Tensor, "n k"], log_depth: Float[Tensor, "n k"], rgb: Float[Tensor, "n k 3"]
) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
    """Mean log depth and colour of the chosen ones, at least one, and the colours' deviation."""
    weight = chosen / chosen.sum(1, keepdim=True).to(rgb)
    color = (rgb * weight[..., None]).sum(1)
    spread = ((rgb - color[:, None]).square().sum(-1) * weight).sum(1).sqrt()
    return (log_depth * weight).sum(1), color, spread


def _disc(
    size_px: tuple[int, int], pixels: tuple[Int[Tensor, " n"], Int[Tensor, " n"]], cell_px: int
) -> tuple[Int[Tensor, "n k"], Int[Tensor, "n k"]]:
    """Rows and columns around each pixel, at most two per cell and axis, inside the image."""
    stride = max(cell_px // 2, 1)
    steps = list(_steps(REACH_CELLS * cell_px, stride))
    offsets = torch.tensor(steps, device=pixels[0].device)
    return tuple(
        (axis[:, None] + offset).clamp(0, side - 1)
        for axis, offset, side in zip(pixels, offsets.T, size_px, strict=True)
    )


def _steps(radius: int, stride: int) -> Iterator[tuple[int, int]]:
    axis = range(-radius, radius + 1, stride)
    return ((row, column) for row in axis for column in axis if row**2 + column**2 <= radius**2)


def _with_neighbours(share: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """The mean of a value and those around it; NaN counts as absent."""
    known = ~share.isnan()
    planes = torch.stack([share.where(known, 0.0), known.to(share)])[None]
    sums = avg_pool2d(planes, 3, 1, 1)[0]
    return (share + sums[0] / sums[1].clamp_min(torch.finfo(share.dtype).tiny)) / 2


def _range(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    """Largest minus smallest value around each pixel."""
    return _largest(values, radius_px) + _largest(-values, radius_px)


def _largest(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    padded = pad(values[None, None], (radius_px,) * 4, mode="replicate")
    rows = max_pool2d(padded, (2 * radius_px + 1, 1), 1)
    return max_pool2d(rows, (1, 2 * radius_px + 1), 1)[0, 0]

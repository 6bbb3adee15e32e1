"""The two sides of the depth edge beside a pixel: their depth, and which one its colour is like.

Axes: ``h w`` pixels, ``n`` pixels beside an edge, ``k`` pixels of the disc around each.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

REACH_CELLS = 2
"""Radius of the disc, in cells of the depth map."""
SIDE_SHARE = 0.25
"""Of the range of log depth around a pixel: what belongs to the nearer side, and to the farther."""
CONTRAST, LEAST_CONTRAST = 0.75, 0.06
"""Colours decide if the sides differ by so many standard deviations, and that much more."""
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
    decide."""


def both_sides(
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
    return Sides(
        near=torch.cat([part.near for part in parts]),
        far=torch.cat([part.far for part in parts]),
        near_share=torch.cat([part.near_share for part in parts]),
    )


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
    decides = contrast > CONTRAST * (near_spread + far_spread) + LEAST_CONTRAST
    return Sides(near=near, far=far, near_share=share.clamp(0, 1).where(decides, torch.nan))


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

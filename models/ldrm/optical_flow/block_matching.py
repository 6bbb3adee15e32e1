"""Large displacements: blocks of one image found in another, forward and backward.

Axes: ``n`` pairs of images, ``h w`` pixels, ``k`` displacements in whole pixels. The cost of a
displacement is the mean difference of colours over a block; above LARGEST_DIFFERENCE all are alike,
so that an occluded part of a block counts no more than another object. A match counts where the
best match of its end is its start (left-right consistency, Fua 1993), and where the block fits
clearly better than at rest: background that is occluded is found nowhere.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.ldrm.optical_flow.lucas_kanade import warp
from diff4splat.models.ldrm.window_mean import window_mean

REACH_PX = 8
DISPLACEMENTS = tuple(range(-REACH_PX, REACH_PX + 1))
"""Along each axis."""
BLOCK_PX = 7
LARGEST_DIFFERENCE = 0.15
LENGTH_COST = 3e-4
"""Per pixel of displacement: without texture the shortest one wins."""
OUTSIDE_COST = 1.0
"""Of displacements that leave the image: above every other cost."""
CLEAR_SHARE = 0.85
"""Of the cost at rest, below which a match counts."""
LEAST_LENGTH_PX, LARGEST_GAP_PX = 1.5, 1.0
"""Shorter matches are left to gradients; distance of a start from the match of its end."""


def matched_displacement(
    source: Float[Tensor, "n 3 h w"], target: Float[Tensor, "n 3 h w"]
) -> tuple[Float[Tensor, "n 2 h w"], Bool[Tensor, "n h w"]]:
    """Displacement (right, down) from ``source`` to ``target`` in pixels, and where it counts."""
    forward, least, at_rest = _best_displacement(source, target)
    backward, _, _ = _best_displacement(target, source)
    gap = (forward + warp(backward, forward)).norm(dim=1)
    long = forward.norm(dim=1) > LEAST_LENGTH_PX
    return forward, long & (gap <= LARGEST_GAP_PX) & (least < CLEAR_SHARE * at_rest)


def _best_displacement(
    source: Float[Tensor, "n 3 h w"], target: Float[Tensor, "n 3 h w"]
) -> tuple[Float[Tensor, "n 2 h w"], Float[Tensor, "n h w"], Float[Tensor, "n h w"]]:
    """Displacement of the least cost, that cost, and the cost at rest."""
    columns = [_column_costs(source, target, right) for right in DISPLACEMENTS]
    least = [costs.min(1) for costs in columns]
    cost, index = torch.stack([one.values for one in least], 1).min(1)
    rows = torch.stack([one.indices for one in least], 1).gather(1, index[:, None])
    displacement = torch.cat([index[:, None], rows], 1).to(source) - REACH_PX
    return displacement, cost, columns[REACH_PX][:, REACH_PX]


def _column_costs(
    source: Float[Tensor, "n 3 h w"], target: Float[Tensor, "n 3 h w"], right: int
) -> Float[Tensor, "n k h w"]:
    """Cost of every pixel's displacements by ``right`` and DISPLACEMENTS down.

    One column at a time: its costs fit into the processor's cache.
    """
    difference = (_displaced(target, right) - source[:, :, None]).abs().mean(1)
    costs = window_mean(difference.clamp_max(LARGEST_DIFFERENCE), BLOCK_PX)
    down = torch.tensor(DISPLACEMENTS).to(source)
    length = LENGTH_COST * (right**2 + down.square()).sqrt()
    outside = 1 - _displaced(torch.ones_like(source[:1, :1]), right)[0, 0]
    return costs + (length[:, None, None] + OUTSIDE_COST * outside)


def _displaced(image: Float[Tensor, "n c h w"], right: int) -> Float[Tensor, "n c k h w"]:
    """The image at x + (right, down) for all DISPLACEMENTS down; 0 outside."""
    height, width = image.shape[-2:]
    padded = torch.nn.functional.pad(image, (REACH_PX,) * 4)
    column = padded[..., REACH_PX + right : REACH_PX + right + width]
    shifts = torch.arange(len(DISPLACEMENTS), device=image.device)[:, None]
    rows = shifts + torch.arange(height, device=image.device)
    return column.index_select(2, rows.flatten()).unflatten(2, rows.shape)

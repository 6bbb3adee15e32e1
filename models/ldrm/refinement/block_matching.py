"""Large displacements: blocks of one image found in another, forward and backward.

Axes: ``n`` pairs of images, ``h w`` pixels, ``k`` displacements in whole pixels. The cost of a
displacement is the mean difference of colours over a block; above LARGEST_DIFFERENCE all are alike,
so that an occluded part of a block counts no more than another object. A match counts where the
best match of its end is its start (left-right consistency, Fua 1993), and where the block fits
clearly better than at rest: background that is occluded is found nowhere.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.models.ldrm.refinement.lucas_kanade import warp
from diff4splat.models.ldrm.refinement.window_mean import window_mean

REACH_PX = 8
"""Longest displacement along each axis."""
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
    costs, displacements = _costs(source, target), _displacements().to(source)
    least, index = costs.min(1)
    forward = displacements[index].movedim(-1, 1)
    backward = displacements[_costs(target, source).argmin(1)].movedim(-1, 1)
    gap = (forward + warp(backward, forward)).norm(dim=1)
    at_rest = costs[:, len(displacements) // 2]
    long = forward.norm(dim=1) > LEAST_LENGTH_PX
    return forward, long & (gap <= LARGEST_GAP_PX) & (least < CLEAR_SHARE * at_rest)


def _displacements() -> Float[Tensor, "k 2"]:
    """All of them (right, down); the one at rest is in the middle."""
    reach = torch.arange(-REACH_PX, REACH_PX + 1).to(torch.get_default_dtype())
    return torch.cartesian_prod(reach, reach)


def _costs(
    source: Float[Tensor, "n 3 h w"], target: Float[Tensor, "n 3 h w"]
) -> Float[Tensor, "n k h w"]:
    """Cost of every displacement of every pixel."""
    difference = (_displaced(target) - source[:, :, None]).abs().mean(1)
    limited = difference.clamp_max(LARGEST_DIFFERENCE)
    length = LENGTH_COST * _displacements().to(source).norm(dim=-1)[:, None, None]
    outside = 1 - _displaced(torch.ones_like(source[:1, :1]))[0, 0]
    return window_mean(limited, BLOCK_PX) + (length + OUTSIDE_COST * outside)


def _displaced(image: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c k h w"]:
    """The image at x + displacement, for every displacement; 0 outside."""
    index = [_shifted_indices(side).to(image.device) for side in image.shape[-2:]]
    padded = torch.nn.functional.pad(image, (REACH_PX,) * 4)
    # Whole columns, then whole rows are copied, which is ten times as fast as single pixels.
    columns = padded.index_select(3, index[1].flatten()).unflatten(3, index[1].shape)
    columns = columns.movedim(3, 2).contiguous()
    rows = columns.index_select(3, index[0].flatten()).unflatten(3, index[0].shape)
    return rows.flatten(2, 3)


def _shifted_indices(side: int) -> Int[Tensor, "r l"]:
    """Indices of a padded axis, for every displacement along it."""
    return torch.arange(2 * REACH_PX + 1)[:, None] + torch.arange(side)

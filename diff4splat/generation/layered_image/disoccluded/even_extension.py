"""A smooth surface over what is not known: close to a membrane (ours).

Axes: ``h w`` pixels, ``h2 w2`` pixels of the copy of half the size.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.windows import block_means

SWEEPS = 40
"""Averages with the neighbours, per level of the pyramid."""


def extended_evenly(
    values: Float[Tensor, "h w"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """``values`` where ``known``, at least somewhere; else close to the mean of the neighbours.

    A coarse copy gives the start, and averaging does the rest: close to a membrane over the hole.
    """
    if bool(known.all()):
        return values
    if min(values.shape) > 1:
        size = [math.ceil(side / 2) for side in values.shape]
        both = torch.stack([known.to(values), torch.where(known, values, 0.0)], -1)
        share, total = block_means(both, 2).unbind(-1)
        coarse = total / share.clamp_min(1e-6)
        start = _enlarged(extended_evenly(coarse, share > 0), size, values.shape)
    else:
        start = values[known].mean().expand_as(values)
    filled = torch.where(known, values, start)
    for _ in range(SWEEPS):
        padded = torch.nn.functional.pad(filled[None, None], (1, 1, 1, 1), mode="replicate")[0, 0]
        mean = (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]) / 4
        filled = torch.where(known, values, mean)
    return filled


def even_colors(rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]) -> Float[Tensor, "h w 3"]:
    """The same for every channel of an image."""
    return torch.stack([extended_evenly(channel, known) for channel in rgb.unbind(-1)], -1)


def _enlarged(
    values: Float[Tensor, "h2 w2"], size: list[int], shape: torch.Size
) -> Float[Tensor, "h w"]:
    even = (2 * size[0], 2 * size[1])
    large = torch.nn.functional.interpolate(
        values[None, None], size=even, mode="bilinear", align_corners=False
    )
    return large[0, 0, : shape[0], : shape[1]]

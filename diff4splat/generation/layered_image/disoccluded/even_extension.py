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
    return _averaged(values, known, start)


def _averaged(
    values: Float[Tensor, "h w"], known: Bool[Tensor, "h w"], start: Float[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """``SWEEPS`` means of the four neighbours where not ``known``, in place: arrays are large."""
    height, width = values.shape
    padded, mean = values.new_empty(height + 2, width + 2), torch.empty_like(values)
    filled = padded[1:-1, 1:-1]
    torch.where(known, values, start, out=filled)
    for _ in range(SWEEPS):
        # Beyond the border lie its own pixels.
        padded[0], padded[-1] = padded[1], padded[-2]
        padded[:, 0], padded[:, -1] = padded[:, 1], padded[:, -2]
        torch.add(padded[:-2, 1:-1], padded[2:, 1:-1], out=mean)
        mean.add_(padded[1:-1, :-2]).add_(padded[1:-1, 2:]).div_(4)
        torch.where(known, values, mean, out=filled)
    return filled.clone()


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

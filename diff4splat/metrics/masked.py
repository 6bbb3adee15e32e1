"""Sums over the part of a map that is known.

Axes: ``*b`` batch, ``p`` places (pixels, points). What stands in hidden places may be NaN: it is
replaced *before* anything is computed with it, because NaN times a zero gradient is NaN.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def zero_masked(values: Float[Tensor, "*d"], keep: Bool[Tensor, "*#d"]) -> Float[Tensor, "*d"]:
    """The values where ``keep``, and 0 elsewhere."""
    return torch.where(keep, values, torch.zeros((), dtype=values.dtype, device=values.device))


def masked_mean(values: Float[Tensor, "*b p"], keep: Bool[Tensor, "*b p"]) -> Float[Tensor, "*b"]:
    """Mean over kept places; 0 with zero gradient where none is kept."""
    return zero_masked(values, keep).sum(-1) / keep.sum(-1).clamp(min=1)


def mean_or_nan(values: Float[Tensor, "*b p"], keep: Bool[Tensor, "*b p"]) -> Float[Tensor, "*b"]:
    """Mean over kept places; NaN where none is kept: the question does not apply."""
    return torch.where(keep.any(-1), masked_mean(values, keep), math.nan)

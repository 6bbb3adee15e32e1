"""Means over a window around every pixel."""

import torch
from jaxtyping import Float
from torch import Tensor


def window_mean(maps: Float[Tensor, "n c h w"], side: int) -> Float[Tensor, "n c h w"]:
    """Over a window within the image; as two matrix products, which are faster than pooling."""
    rows, columns = (_averaging(length, side).to(maps) for length in maps.shape[-2:])
    return rows @ maps @ columns.mT


def _averaging(length: int, side: int) -> Float[Tensor, "l l"]:
    """Matrix whose rows average a window centred on each index."""
    index = torch.arange(length)
    within = ((index[:, None] - index).abs() <= side // 2).float()
    return within / within.sum(1, keepdim=True)

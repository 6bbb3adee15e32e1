"""Gradients that overflow are held at a large number.

The gradient in a tiny quaternion or direction is as large as its inverse length. As infinity it
would become NaN one multiplication further on.
"""

import torch
from torch import Tensor

ROOM = 0.01
"""Of the largest number: sums of a few saturated gradients stay finite."""


def saturate_(gradient: Tensor) -> Tensor:
    """``gradient`` itself, with its numbers held to what its dtype can add up."""
    limit = ROOM * torch.finfo(gradient.dtype).max
    return gradient.clamp_(-limit, limit)

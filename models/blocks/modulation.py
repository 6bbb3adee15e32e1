"""Adaptive layer norm: a condition scales and shifts a residual branch (DiT, arXiv 2212.09748).

Axes: ``b`` batch, ``d`` width, ``e`` width of the condition. ``x + gate · f(norm(x) · (1 + scale)
+ shift)``. The projections start at zero, so a fresh block is the identity.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_


def modulate(
    tokens: Float[Tensor, "*b d"], shift: Float[Tensor, "*#b d"], scale: Float[Tensor, "*#b d"]
) -> Float[Tensor, "*b d"]:
    """Scale by 1 + ``scale``, then shift: zero means unchanged."""
    return tokens * (1 + scale) + shift


class ZeroModulation(nn.Module):
    """Linear map of a condition to ``count`` modulation vectors, zero at first."""

    def __init__(self, condition_width: int, width: int, count: int) -> None:
        super().__init__()
        self.count = count
        self.project = zero_(nn.Linear(condition_width, count * width))

    def forward(self, condition: Float[Tensor, "*b e"]) -> Float[Tensor, "*b k d"]:
        """The vectors, stacked before the last axis."""
        return self.project(torch.nn.functional.silu(condition)).unflatten(-1, (self.count, -1))

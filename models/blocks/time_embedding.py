"""Sinusoidal embeddings of noise levels and of times, always computed in float32 or wider.

Axes: ``*b`` batch. Half precision would spoil the angles: a level of 0.7 times 1000 is off by 0.25
in float16 and by 2 in bfloat16.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.precision import at_least_float32

LEVEL_SCALE = 1000.0
"""Levels in [0, 1] are embedded as 0 … 1000, the time steps of public flow models (Wan)."""
LONGEST_PERIOD = 10000.0


def level_embedding(level: Float[Tensor, "*b"], width: int) -> Float[Tensor, "*b {width}"]:
    """cos, then sin, of 1000 · level at geometrically spaced frequencies 1 … 1/10000."""
    half, wide = width // 2, at_least_float32(level)
    exponent = torch.arange(half, dtype=wide.dtype, device=level.device) / half
    angle = LEVEL_SCALE * wide[..., None] * LONGEST_PERIOD**-exponent
    return torch.cat([angle.cos(), angle.sin()], -1)


def fourier_embedding(
    time: Float[Tensor, "*b"], frequencies: int
) -> Float[Tensor, "*b {2*frequencies}"]:
    """sin, then cos, of π 2^k · time for k = 0 … frequencies − 1; ``time`` in [0, 1]."""
    wide = at_least_float32(time)
    frequency = math.pi * 2.0 ** torch.arange(frequencies, dtype=wide.dtype, device=time.device)
    angle = wide[..., None] * frequency
    return torch.cat([angle.sin(), angle.cos()], -1)


class EmbeddingMlp(nn.Module):
    """Sinusoid → width: linear, SiLU, linear."""

    def __init__(self, input_width: int, width: int) -> None:
        super().__init__()
        self.expand = nn.Linear(input_width, width)
        self.contract = nn.Linear(width, width)

    def forward(self, embedding: Float[Tensor, "*b e"]) -> Float[Tensor, "*b d"]:
        """Cast to the weights' dtype only here, after the sinusoids."""
        hidden = self.expand(embedding.to(self.expand.weight.dtype))
        return self.contract(torch.nn.functional.silu(hidden))

"""Root-mean-square normalisation of feature maps and tokens.

Axes: ``b`` batch, ``c`` channels, ``...`` positions, ``d`` width of a token. y = gain · x /
sqrt(mean_c(x²) + ε) at every position separately, so a video cut into chunks is normalised exactly
as the whole video (unlike GroupNorm).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.precision import at_least_float32

EPSILON = 1e-6


class ChannelRmsNorm(nn.Module):
    """Root-mean-square norm over channels, with a gain per channel."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.gain = nn.Parameter(torch.ones(channels))

    def forward(self, features: Float[Tensor, "b c ..."]) -> Float[Tensor, "b c ..."]:
        """Squares are summed in at least float32: half precision overflows from 256 on."""
        wide = at_least_float32(features)
        inverse = torch.rsqrt(wide.square().mean(1, keepdim=True) + EPSILON)
        gain = self.gain.to(features.dtype).view(-1, *[1] * (features.dim() - 2))
        return (wide * inverse).to(features.dtype) * gain


class TokenRmsNorm(nn.RMSNorm):
    """The same over the width of a token; PyTorch sums half precision in float32."""

    def __init__(self, width: int) -> None:
        super().__init__(width, eps=EPSILON)

    def forward(self, tokens: Float[Tensor, "*b d"]) -> Float[Tensor, "*b d"]:
        """The gain follows the tokens, which mixed precision may have cast to half precision."""
        gain = self.weight.to(tokens.dtype)
        return torch.nn.functional.rms_norm(tokens, self.normalized_shape, gain, EPSILON)

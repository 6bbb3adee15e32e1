"""Separable convolutions of MI-GAN, with its activation and its resampling.

Axes: ``n`` images, ``c`` and ``d`` channels, ``h w`` cells, ``h2 w2`` half or twice as many.
"""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import conv2d, interpolate, leaky_relu, pad

SLOPE = 0.2
BINOMIAL = (0.125, 0.375, 0.375, 0.125)
"""The filter of both ways of resampling (StyleGAN 2, arXiv 1912.04958)."""
Resampling = Literal["none", "halved", "doubled"]


class SeparableConv(nn.Module):
    """Every channel by itself, then all channels of a cell; resampled beside the second."""

    def __init__(self, channels: int, out_channels: int, resampling: Resampling = "none") -> None:
        super().__init__()
        self.resampling = resampling
        self.depthwise = nn.Conv2d(channels, channels, 3, padding=1, groups=channels)
        self.pointwise = nn.Conv2d(channels, out_channels, 1, bias=False)

    def forward(self, states: Float[Tensor, "n c h w"]) -> Float[Tensor, "n d h2 w2"]:
        """Activated states."""
        states = activated(self.depthwise(states))
        if self.resampling == "halved":
            states = halved(states)
        states = self.pointwise(states)
        return activated(doubled(states) if self.resampling == "doubled" else states)


def activated(states: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h w"]:
    """In place: at 512 px a copy takes as long as a convolution."""
    return leaky_relu(states, SLOPE, inplace=True)


def halved(states: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h2 w2"]:
    """Half the sides, by the binomial filter; zero outside."""
    row = states.new_tensor(BINOMIAL)
    kernel = torch.outer(row, row).expand(states.shape[1], 1, 4, 4)
    return conv2d(states, kernel, stride=2, padding=1, groups=states.shape[1])


def doubled(states: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h2 w2"]:
    """Twice the sides; the binomial filter is bilinear interpolation, with zero outside."""
    around = pad(states, (1, 1, 1, 1))
    large = interpolate(around, scale_factor=2.0, mode="bilinear", align_corners=False)
    return large[..., 2:-2, 2:-2]

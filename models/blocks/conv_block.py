"""Residual convolution block, and convex upsampling from cells of four pixels to pixels.

Axes: ``n`` images, ``c`` channels, ``h w`` cells, ``h4 w4`` pixels. Convex upsampling: every pixel
is a weighted mean of 3×3 cells, with weights that a network predicts (RAFT, arXiv 2003.12039,
§3.3). Means cannot overshoot, and a weight near 1 gives a sharp edge.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.norm import ChannelRmsNorm

CELL_PX = 4
"""Pixels per cell side."""
NEIGHBOURS = 9


class ConvBlock(nn.Module):
    """x + conv(silu(norm(conv(silu(norm(x))))))."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm_1, self.norm_2 = ChannelRmsNorm(channels), ChannelRmsNorm(channels)
        self.conv_1 = nn.Conv2d(channels, channels, 3, padding=1)
        self.conv_2 = nn.Conv2d(channels, channels, 3, padding=1)

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h w"]:
        """Same size."""
        hidden = self.conv_1(torch.nn.functional.silu(self.norm_1(features)))
        return features + self.conv_2(torch.nn.functional.silu(self.norm_2(hidden)))


def cells(images: Float[Tensor, "n c h4 w4"]) -> Float[Tensor, "n c16 h w"]:
    """The 16 pixels of every cell as channels."""
    return torch.nn.functional.pixel_unshuffle(images, CELL_PX)


def convex_upsample(
    maps: Float[Tensor, "n c h w"], weights: Float[Tensor, "n 144 h w"]
) -> Float[Tensor, "n c h4 w4"]:
    """Pixels from cells; ``weights`` are logits, equal ones give the mean of the neighbours."""
    channels, height, width = maps.shape[1:]
    shares = weights.unflatten(1, (NEIGHBOURS, CELL_PX**2)).softmax(1)
    padded = torch.nn.functional.pad(maps, (1, 1, 1, 1), mode="replicate")
    neighbours = torch.nn.functional.unfold(padded, 3).unflatten(1, (channels, NEIGHBOURS))
    # As a product of small matrices: the products of all pixels and neighbours are never stored.
    pixels = torch.einsum("nckp,nksp->ncsp", neighbours, shares.flatten(3))
    pixels = pixels.unflatten(-1, (height, width))
    return torch.nn.functional.pixel_shuffle(pixels.flatten(1, 2), CELL_PX)

"""Depth prior: a U-Net from one image to the ray distance of its pixels (ours; ADR 23).

Axes: ``b`` batch, ``h w`` pixels. One image has no parallax, so refinement, which works on cells of
four pixels, does not apply. Shading, size and position are the cues, depth edges are colour edges,
and any image with ground-truth depth can train the network.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.image_unet.network import ImageUNet

GROWTH = (1, 2, 3, 4)
"""Channels at 1/2, 1/4, 1/8 and 1/16 of the resolution, in multiples of the configured width."""


class MonocularDepthNet(ImageUNet):
    """Raw ray distance of every pixel; zero, the plane, when fresh."""

    def __init__(self, width: int) -> None:
        channels = [width * share for share in GROWTH]
        super().__init__(channels, lambda level: ConvBlock(channels[level]))
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))

    def make_mid(self, channels: int) -> nn.Module:
        """One more block."""
        return ConvBlock(channels)

    def forward(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 1 h w"]:
        """``image`` is RGB in [0, 1], its sides multiples of 16."""
        return torch.nn.functional.pixel_shuffle(self.head(self.features(image)), FOLDED_PX)

    def predict_distance_and_uncertainty(
        self, image: Float[Tensor, "b 3 h w"]
    ) -> tuple[Float[Tensor, "b 1 h w"], None]:
        """The same: it has one encoder, and does not know how far off it is."""
        return self(image), None

"""Refines the motion mask at pixels: a small U-Net beside the motion U-Net (ours; ADR 25).

Axes: ``b`` batch, ``hh ww`` pixels, ``hc wc`` cells of 4 pixels, ``c`` channels of the motion
U-Net, which selects the object that the text names, on cells; this network adds its edges.

    image, coordinates ─ cells of 2 ─ 1/2 ─────────── 1/2 ─ conv (zero) ─ logits
    features of the motion U-Net ─ linear ─ + 1/4 ── 1/4 ┘
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.image_unet.network import pixel_coordinates


class MaskRefiner(nn.Module):
    """Logits to add to those of the motion U-Net; zero when fresh."""

    def __init__(self, width: int, channels: int) -> None:
        super().__init__()
        self.input_image = nn.Conv2d((3 + 2) * FOLDED_PX**2, width, 3, padding=1)
        self.fine, self.fine_out = ConvBlock(width), ConvBlock(width)
        self.down = nn.Conv2d(width, 2 * width, 2, stride=2)
        self.input_features = nn.Conv2d(channels, 2 * width, 1)
        self.coarse = nn.Sequential(ConvBlock(2 * width), ConvBlock(2 * width))
        self.up = nn.Conv2d(2 * width, 4 * width, 1)
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))

    def forward(
        self, image: Float[Tensor, "b 3 hh ww"], features: Float[Tensor, "b c hc wc"]
    ) -> Float[Tensor, "b hh ww"]:
        """``image`` is RGB in [0, 1], its sides multiples of 4."""
        inputs = torch.cat([image * 2 - 1, pixel_coordinates(image)], 1)
        fine = self.fine(self.input_image(torch.nn.functional.pixel_unshuffle(inputs, FOLDED_PX)))
        coarse = self.coarse(self.down(fine) + self.input_features(features))
        upsampled = torch.nn.functional.pixel_shuffle(self.up(coarse), 2)
        logits = self.head(self.fine_out(fine + upsampled))
        return torch.nn.functional.pixel_shuffle(logits, FOLDED_PX)[:, 0]

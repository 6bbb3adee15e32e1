"""Fused features to raw maps: of the key frames' pixels, and of what lies around the first one.

Axes: ``b`` batch, ``k`` key frames, ``n`` = b k, ``c`` channels, ``h w`` cells of 4 pixels,
``h4 w4`` pixels, ``hs ws`` cells with the surroundings. Ray distances are enlarged convexly, so
that edges of depth stay sharp; all other attributes have a value of their own in every pixel.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX, NEIGHBOURS, ConvBlock, convex_upsample
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.config.networks import GAUSSIAN_SPLIT

APPEARANCE = sum(GAUSSIAN_SPLIT[:-1])
"""Channels of colour, scale, rotation and opacity."""


class PixelHead(nn.Module):
    """Twelve raw channels for every pixel of the key frames; zero when fresh."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.distance = zero_(nn.Conv2d(width, 1, 3, padding=1))
        self.weights = nn.Conv2d(width, NEIGHBOURS * CELL_PX**2, 1)
        self.appearance = zero_(nn.Conv2d(width, APPEARANCE * CELL_PX**2, 1))

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n 12 h4 w4"]:
        """In the order of GAUSSIAN_SPLIT."""
        distance = convex_upsample(self.distance(features), self.weights(features))
        appearance = torch.nn.functional.pixel_shuffle(self.appearance(features), CELL_PX)
        return torch.cat([appearance, distance], 1)


class BorderHead(nn.Module):
    """Twelve raw channels for every cell of the first picture and of a margin around it."""

    def __init__(self, width: int, margin: int) -> None:
        super().__init__()
        self.margin = margin
        self.input_conv = nn.Conv2d(width + 2, width, 3, padding=1)
        self.local = ConvBlock(width)
        self.downsample = nn.Conv2d(width, width, 4, stride=4)
        self.context = nn.Sequential(ConvBlock(width), ConvBlock(width))
        self.out = zero_(nn.Conv2d(2 * width, sum(GAUSSIAN_SPLIT), 3, padding=1))

    def forward(self, features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 12 hs ws"]:
        """From the features of the first frame; borders continue outwards."""
        around = replicate_border(features, self.margin)
        local = self.local(self.input_conv(torch.cat([around, self._places(around)], 1)))
        context = self.context(self.downsample(local))
        context = torch.nn.functional.interpolate(context, local.shape[-2:], mode="bilinear")
        return self.out(torch.cat([local, context], 1))

    def _places(self, around: Tensor) -> Float[Tensor, "b 2 hs ws"]:
        """How far outside the picture a cell lies, across and down; 0 inside, in margins."""
        height, width = around.shape[-2:]
        axes = [self._beyond(size).to(around) for size in (height, width)]
        down, across = torch.meshgrid(*axes, indexing="ij")
        return torch.stack([across, down]).expand(len(around), -1, -1, -1)

    def _beyond(self, size: int) -> Float[Tensor, " s"]:
        place = torch.arange(size, dtype=torch.float32)
        after = (place - (size - 1 - self.margin)).clamp_min(0)
        return (after - (self.margin - place).clamp_min(0)) / max(self.margin, 1)


def replicate_border(maps: Float[Tensor, "b c h w"], margin: int) -> Float[Tensor, "b c hs ws"]:
    """The border continues outwards by ``margin`` cells."""
    return torch.nn.functional.pad(maps, (margin,) * 4, mode="replicate")

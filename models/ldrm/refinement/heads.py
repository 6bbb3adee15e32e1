"""Fused features to raw maps of the key frames' pixels and of the border extension.

Axes: ``b`` batch, ``k`` key frames, ``n`` = b k, ``c`` channels, ``h w`` cells of 4 pixels,
``h4 w4`` pixels, ``hs ws`` cells with the margin. Ray distances are upsampled convexly, which
keeps depth edges sharp; all other attributes are predicted for every pixel.
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


class ShareHead(nn.Module):
    """How much of what parallax changes is taken over, per pixel; all of it when fresh."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.out = zero_(nn.Conv2d(width, CELL_PX**2, 1))

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n 1 h4 w4"]:
        """Around 1, not bounded."""
        return 1 + torch.nn.functional.pixel_shuffle(self.out(features), CELL_PX)


class BorderHead(nn.Module):
    """Twelve raw channels for every cell of the first frame and of a margin on each side."""

    def __init__(self, width: int, margin: int) -> None:
        super().__init__()
        self.margin = margin
        self.input_conv = nn.Conv2d(width + 2, width, 3, padding=1)
        self.local = ConvBlock(width)
        self.downsample = nn.Conv2d(width, width, 4, stride=4)
        self.context = nn.Sequential(ConvBlock(width), ConvBlock(width))
        self.out = zero_(nn.Conv2d(2 * width, sum(GAUSSIAN_SPLIT), 3, padding=1))

    def forward(self, features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 12 hs ws"]:
        """From the features of the first frame, whose border is replicated."""
        extended = replicate_border(features, self.margin)
        local = self.local(self.input_conv(torch.cat([extended, self._coordinates(extended)], 1)))
        context = self.context(self.downsample(local))
        context = torch.nn.functional.interpolate(context, local.shape[-2:], mode="bilinear")
        return self.out(torch.cat([local, context], 1))

    def _coordinates(self, extended: Tensor) -> Float[Tensor, "b 2 hs ws"]:
        """Signed distance of a cell beyond the image border, x and y, in margins; 0 inside."""
        height, width = extended.shape[-2:]
        axes = [self._beyond(size).to(extended) for size in (height, width)]
        y, x = torch.meshgrid(*axes, indexing="ij")
        return torch.stack([x, y]).expand(extended.shape[0], -1, -1, -1)

    def _beyond(self, size: int) -> Float[Tensor, " s"]:
        index = torch.arange(size, dtype=torch.float32)
        after = (index - (size - 1 - self.margin)).clamp_min(0)
        return (after - (self.margin - index).clamp_min(0)) / max(self.margin, 1)


def replicate_border(maps: Float[Tensor, "b c h w"], margin: int) -> Float[Tensor, "b c hs ws"]:
    """Replicate the border by ``margin`` cells on each side."""
    return torch.nn.functional.pad(maps, (margin,) * 4, mode="replicate")

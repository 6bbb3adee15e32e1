"""Object mask: the pixels of what a prompt asks to move (ours; ADR 29), on a U-Net of its own.

Axes: ``b`` images, ``h w`` pixels, ``c`` channels.
"""

from torch import nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.image_unet.network import ImageUNet
from diff4splat.models.object_mask.mask_heads import HeadShape, MaskHeads

GROWTH = (1, 2, 5, 8)
"""Channels at 1/2, 1/4, 1/8 and 1/16 of the resolution, in multiples of the configured width."""
BLOCKS = (0, 1, 2, 3)
"""Residual blocks at each of them on the way down; one on the way up."""


class MaskUNet(ImageUNet):
    """Features of every cell of two pixels."""

    def __init__(self, width: int) -> None:
        channels = [width * share for share in GROWTH]
        super().__init__(channels, lambda level: _blocks(channels[level], BLOCKS[level]))


class ObjectMaskNet(MaskUNet, MaskHeads):
    """For every pixel the logit of the probability that the prompt asks it to move."""

    def __init__(self, shape: HeadShape) -> None:
        super().__init__(shape.width)
        self.add_heads(shape)


def _blocks(channels: int, count: int) -> nn.Sequential:
    return nn.Sequential(*[ConvBlock(channels) for _ in range(count)])

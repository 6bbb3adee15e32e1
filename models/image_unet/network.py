"""A U-Net from the pixels of one image to features at half the resolution.

Axes: ``b`` images, ``h w`` pixels, ``c`` channels.

    image, coordinates ─ cells of 2 ─ 1/2 ── 1/4 ── 1/8 ── 1/16 ── 1/8 ── 1/4 ── 1/2 ─ features
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.image_unet.cells import FOLDED_PX, LEVELS


class ImageUNet(nn.Module):
    """Convolutions at four resolutions; heads are those of the networks that extend it."""

    def __init__(
        self,
        channels: Sequence[int],
        down_block: Callable[[int], nn.Module],
        image_channels: int = 3,
    ) -> None:
        """``channels`` of every resolution, finest first; ``down_block`` makes that of a level."""
        super().__init__()
        steps = list(pairwise(channels))
        inputs = (image_channels + 2) * FOLDED_PX**2
        self.input_conv = nn.Conv2d(inputs, channels[0], 3, padding=1)
        self.down_blocks = nn.ModuleList([down_block(level) for level in range(LEVELS)])
        self.downsample = nn.ModuleList(
            [nn.Conv2d(fine, coarse, 2, stride=2) for fine, coarse in steps]
        )
        self.upsample = nn.ModuleList([nn.Conv2d(coarse, 4 * fine, 1) for fine, coarse in steps])
        self.mid = self.make_mid(channels[-1])
        self.up_blocks = nn.ModuleList([ConvBlock(count) for count in channels[:-1]])

    def make_mid(self, channels: int) -> nn.Module:
        """What follows the coarsest level."""
        del channels
        return nn.Identity()

    def features(self, image: Float[Tensor, "b k h w"]) -> Float[Tensor, "b c h2 w2"]:
        """``image`` is RGB, and what else a network sees, in [0, 1]; sides are multiples of 16."""
        inputs = torch.cat([image * 2 - 1, pixel_coordinates(image)], 1)
        features = self.input_conv(torch.nn.functional.pixel_unshuffle(inputs, FOLDED_PX))
        skips = []
        for block, downsample in zip(self.down_blocks, self.downsample, strict=False):
            skips.append(block(features))
            features = downsample(skips[-1])
        features = self.mid(self.down_blocks[-1](features))
        return upsample_path(features, skips, self.upsample, self.up_blocks)


def upsample_path(
    features: Float[Tensor, "b c h w"],
    skips: Sequence[Tensor],
    upsample: nn.ModuleList,
    blocks: nn.ModuleList,
) -> Tensor:
    """From the coarsest features to those of the finest of ``skips``, which are finest first."""
    for level in reversed(range(len(upsample))):
        finer = torch.nn.functional.pixel_shuffle(upsample[level](features), 2)
        features = blocks[level](skips[level] + finer)
    return features


def pixel_coordinates(image: Float[Tensor, "b k h w"]) -> Float[Tensor, "b 2 h w"]:
    """X and y of the pixel centres, −1 and 1 at the edges of the image."""
    y, x = (
        (2 * torch.arange(size, device=image.device, dtype=image.dtype) + 1) / size - 1
        for size in image.shape[2:]
    )
    return torch.stack(torch.meshgrid(x, y, indexing="xy")).expand(image.shape[0], -1, -1, -1)

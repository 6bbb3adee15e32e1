"""Depth prior: a U-Net from one image to the ray distance of its pixels (ours; ADR 23).

Axes: ``b`` batch, ``h w`` pixels. One image has no parallax, so refinement, which works on cells of
four pixels, does not apply. Shading, size and position are the cues, depth edges are colour edges,
and any image with ground-truth depth can train the network.

    image, coordinates ─ cells of 2 ─ 1/2 ── 1/4 ── 1/8 ── 1/16 ── 1/8 ── 1/4 ── 1/2 ─ raw distance
"""

from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.blocks.initialise import zero_

FOLDED_PX = 2
"""Pixels per side that become channels before the first convolution."""
GROWTH = (1, 2, 3, 4)
"""Channels at 1/2, 1/4, 1/8 and 1/16 of the resolution, in multiples of the configured width."""
MULTIPLE_PX = FOLDED_PX << (len(GROWTH) - 1)
"""Image sides must be multiples of it."""


class MonocularDepthNet(nn.Module):
    """Raw ray distance of every pixel; zero, the plane, when fresh."""

    def __init__(self, width: int) -> None:
        super().__init__()
        channels = [width * share for share in GROWTH]
        steps = list(pairwise(channels))
        self.input_conv = nn.Conv2d((3 + 2) * FOLDED_PX**2, width, 3, padding=1)
        self.down_blocks = nn.ModuleList([ConvBlock(count) for count in channels])
        self.downsample = nn.ModuleList(
            [nn.Conv2d(fine, coarse, 2, stride=2) for fine, coarse in steps]
        )
        self.upsample = nn.ModuleList([nn.Conv2d(coarse, 4 * fine, 1) for fine, coarse in steps])
        self.mid = ConvBlock(channels[-1])
        self.up_blocks = nn.ModuleList([ConvBlock(count) for count in channels[:-1]])
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))

    def forward(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 1 h w"]:
        """``image`` is RGB in [0, 1], its sides multiples of 16."""
        inputs = torch.cat([image * 2 - 1, pixel_coordinates(image)], 1)
        features = self.input_conv(torch.nn.functional.pixel_unshuffle(inputs, FOLDED_PX))
        skips = []
        for block, downsample in zip(self.down_blocks, self.downsample, strict=False):
            skips.append(block(features))
            features = downsample(skips[-1])
        features = self.mid(self.down_blocks[-1](features))
        for level in reversed(range(len(self.up_blocks))):
            upsampled = torch.nn.functional.pixel_shuffle(self.upsample[level](features), 2)
            features = self.up_blocks[level](skips[level] + upsampled)
        return torch.nn.functional.pixel_shuffle(self.head(features), FOLDED_PX)


def pixel_coordinates(image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 2 h w"]:
    """X and y of the pixel centres, −1 and 1 at the edges of the image."""
    y, x = (
        (2 * torch.arange(size, device=image.device, dtype=image.dtype) + 1) / size - 1
        for size in image.shape[2:]
    )
    return torch.stack(torch.meshgrid(x, y, indexing="xy")).expand(len(image), -1, -1, -1)

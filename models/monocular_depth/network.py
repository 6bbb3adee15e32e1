"""Depth of one picture alone: a U-Net that starts at its pixels (ours; docs/adr/0023).

Axes: ``b`` batch, ``h w`` pixels. The detail decoder sees cells of four pixels and was made for
videos, where parallax tells depth. In one picture only shading, size and place do, edges of depth
are edges of colour, and every picture with a true depth can teach it: no scene is rendered.

    picture, place ─ cells of 2 ─ 1/2 ── 1/4 ── 1/8 ── 1/16 ── 1/8 ── 1/4 ── 1/2 ─ raw distance
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
"""What the size of a picture must be a multiple of."""


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

    def forward(self, picture: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 1 h w"]:
        """``picture`` is RGB in [0, 1], its sides multiples of 16."""
        seen = torch.cat([picture * 2 - 1, pixel_coordinates(picture)], 1)
        features = self.input_conv(torch.nn.functional.pixel_unshuffle(seen, FOLDED_PX))
        passed = []
        for block, shrink in zip(self.down_blocks, self.downsample, strict=False):
            passed.append(block(features))
            features = shrink(passed[-1])
        features = self.mid(self.down_blocks[-1](features))
        for level in reversed(range(len(self.up_blocks))):
            larger = torch.nn.functional.pixel_shuffle(self.upsample[level](features), 2)
            features = self.up_blocks[level](passed[level] + larger)
        return torch.nn.functional.pixel_shuffle(self.head(features), FOLDED_PX)


def pixel_coordinates(picture: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 2 h w"]:
    """X and y of the pixels' centres, −1 and 1 at the edges of the picture."""
    y, x = (
        (2 * torch.arange(size, device=picture.device, dtype=picture.dtype) + 1) / size - 1
        for size in picture.shape[2:]
    )
    return torch.stack(torch.meshgrid(x, y, indexing="xy")).expand(len(picture), -1, -1, -1)

"""Features of the image backbone, decoded to half the resolution of the image.

Axes: ``b`` images, ``h w`` pixels, ``c`` channels. No coordinates enter: what follows must come
from what is shown.

    image ─ backbone ─ 1/32 ─ 1/16 ─ 1/8 ─ 1/4 ─ 1/2 ─ features
      └──── cells of 2 px ───────────────────────┘
"""

from collections.abc import Sequence
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.image_backbone.efficientnet_lite import FEATURE_CHANNELS, EfficientNetLite
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.image_unet.network import upsample_path


class BackboneUNet(nn.Module):
    """The backbone on the way down, a block per resolution on the way up."""

    def __init__(self, channels: Sequence[int], size: BackboneSize = "lite0") -> None:
        """``channels`` at 1/2, 1/4, 1/8, 1/16, 1/32 of the resolution, or at the first of them."""
        super().__init__()
        self.backbone = EfficientNetLite(len(channels), size)
        levels = zip(FEATURE_CHANNELS[size][: len(channels)], channels, strict=True)
        self.lateral = nn.ModuleList([nn.Conv2d(*pair, 1) for pair in levels])
        self.pixels = nn.Conv2d(3 * FOLDED_PX**2, channels[0], 3, padding=1)
        self.blocks = nn.ModuleList([ConvBlock(count) for count in channels])
        self.upsample = nn.ModuleList(
            [nn.Conv2d(coarse, 4 * fine, 1) for fine, coarse in pairwise(channels)]
        )

    def features(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c h2 w2"]:
        """``image`` is RGB in [0, 1], its sides multiples of the coarsest cell."""
        levels = self.backbone(image)
        skips = [conv(level) for conv, level in zip(self.lateral, levels, strict=True)]
        cells = torch.nn.functional.pixel_unshuffle(image * 2 - 1, FOLDED_PX)
        skips[0] = skips[0] + self.pixels(cells)
        return upsample_path(self.blocks[-1](skips[-1]), skips, self.upsample, self.blocks)

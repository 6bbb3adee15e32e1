"""Depth prior with two encoders: a U-Net of its own and the image backbone (ADR 32).

Axes: ``b`` batch, ``h w`` pixels. The U-Net knows where in the image a pixel lies and what drawn
worlds look like, the backbone what photographs show. Their errors differ, so the mean of their raw
distances is better than either.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.monocular_depth.network import MonocularDepthNet

GROWTH = (1, 2, 3, 4, 4)
"""Channels at 1/2 to 1/32 of the resolution, in multiples of the configured width."""


class BackboneDepthNet(BackboneUNet):
    """Raw ray distance of every pixel; zero, the plane, when fresh."""

    def __init__(self, width: int) -> None:
        super().__init__([width * share for share in GROWTH])
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))
        self.unet = MonocularDepthNet(width)

    def forward(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 1 h w"]:
        """``image`` is RGB in [0, 1], its sides multiples of 32."""
        raw = torch.nn.functional.pixel_shuffle(self.head(self.features(image)), FOLDED_PX)
        return (raw + self.unet(image)) / 2

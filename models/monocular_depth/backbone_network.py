"""Depth prior with two encoders: a U-Net of its own and the image backbone (ADR 32).

Axes: ``b`` batch, ``h w`` pixels. The U-Net knows where in the image a pixel lies and what drawn
worlds look like, the backbone what photographs show. Their errors differ, so the mean of their raw
distances is better than either. How far they differ says how far an image is out of domain.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.monocular_depth.uncertainty import UncertaintyHead

GROWTH = (1, 2, 3, 4, 4)
"""Channels at 1/2 to 1/32 of the resolution, in multiples of the configured width."""


class BackboneDepthNet(BackboneUNet):
    """Raw ray distance of every pixel; zero, the plane, when fresh."""

    def __init__(
        self, width: int, *, size: BackboneSize = "lite0", uncertainty: bool = False
    ) -> None:
        super().__init__([width * share for share in GROWTH], size)
        self.head = zero_(nn.Conv2d(width, FOLDED_PX**2, 3, padding=1))
        self.unet = MonocularDepthNet(width)
        self.uncertainty = UncertaintyHead(2 * width) if uncertainty else None

    def forward(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 1 h w"]:
        """``image`` is RGB in [0, 1], its sides multiples of 32."""
        raw = _pixels(self.head(self.features(image)))
        return (raw + self.unet(image)) / 2

    def predict_distance_and_uncertainty(
        self, image: Float[Tensor, "b 3 h w"]
    ) -> tuple[Float[Tensor, "b 2 h w"], Float[Tensor, "b 1 h w"] | None]:
        """Raw ray distance by the backbone and by the U-Net, and the log uncertainty of both."""
        of_backbone, of_unet = self.features(image), self.unet.features(image)
        raw = torch.cat([_pixels(self.head(of_backbone)), _pixels(self.unet.head(of_unet))], 1)
        if self.uncertainty is None:
            return raw, None
        return raw, self.uncertainty(torch.cat([of_backbone, of_unet], 1))


def _pixels(cells: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 1 h2 w2"]:
    return torch.nn.functional.pixel_shuffle(cells, FOLDED_PX)

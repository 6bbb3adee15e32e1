"""Object mask with two encoders: a U-Net of its own and the image backbone (ADR 32).

Axes: ``b`` images, ``h w`` pixels, ``c`` channels. The U-Net knows drawn worlds, the backbone what
photographs show. A pixel's embedding is linear in the features of both.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.object_mask.mask_heads import HeadShape, MaskHeads
from diff4splat.models.object_mask.network import MaskUNet

GROWTH = (1, 2, 4, 6)
"""Channels at 1/2 to 1/16 of the resolution, in multiples of the configured width: most objects
are smaller than cells of 1/32."""


class BackboneObjectMaskNet(BackboneUNet, MaskHeads):
    """For every pixel the logit of the probability that the prompt asks it to move."""

    def __init__(self, shape: HeadShape, size: BackboneSize = "lite0") -> None:
        super().__init__([shape.width * share for share in GROWTH], size)
        self.unet = MaskUNet(shape.width)
        self.add_heads(shape, encoders=2)

    def features(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c h2 w2"]:
        """``image`` is RGB in [0, 1], its sides multiples of 16."""
        return torch.cat([super().features(image), self.unet.features(image)], 1)

"""Object mask on the image backbone (ADR 32): it knows what photographs show.

Axes: ``b`` images, ``h w`` pixels, ``c`` channels.
"""

from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.object_mask.mask_heads import MaskHeads

GROWTH = (1, 2, 4, 6, 6)
"""Channels at 1/2 to 1/32 of the resolution, in multiples of the configured width."""


class BackboneObjectMaskNet(BackboneUNet, MaskHeads):
    """For every pixel the logit of the probability that the prompt asks it to move."""

    def __init__(self, width: int, text_width: int) -> None:
        super().__init__([width * share for share in GROWTH])
        self.add_heads(width, text_width)

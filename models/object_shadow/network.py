"""Object shadow: a U-Net from an image and the mask of an object to the shadow it casts (ours).

Axes: ``b`` batch, ``h w`` pixels.

    image, mask ─────────────────┐
    mask ─ object's coordinates ─┴ image U-Net ─ conv (zero) ─ darkening of every channel

A shadow is a ratio: without the object a pixel has exp(darkening) times its colour. Other shadows
of the image show where the light comes from, and the mask which of them is asked for. Coordinates
in the object's own size say how far a pixel is from it.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import ConvBlock
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.image_unet.network import ImageUNet, pixel_coordinates

REACH = 6.0
"""Distance from the middle of the object, in its standard deviations, at which coordinates end."""
INPUTS = 3 + 1 + 2
"""Channels: colours, mask, coordinates."""
LEAST_SHARE = 1e-6
"""Of every pixel in the object's size, so that an empty mask has one."""
GROWTH = (1, 2, 3, 4)
"""Channels at 1/2, 1/4, 1/8 and 1/16 of the resolution, in multiples of the configured width."""


class ObjectShadowNet(ImageUNet):
    """Logarithm of each pixel's colour without the object over that with it; 0 when fresh.

    Where there is no shadow it is near 0, of either sign.
    """

    def __init__(self, width: int) -> None:
        channels = [width * share for share in GROWTH]
        super().__init__(channels, lambda level: ConvBlock(channels[level]), image_channels=INPUTS)
        self.head = zero_(nn.Conv2d(width, 3 * FOLDED_PX**2, 3, padding=1))

    def make_mid(self, channels: int) -> nn.Module:
        """One more block."""
        return ConvBlock(channels)

    def forward(
        self, image: Float[Tensor, "b 3 h w"], mask: Float[Tensor, "b h w"]
    ) -> Float[Tensor, "b 3 h w"]:
        """``image`` is RGB in [0, 1], its sides multiples of 16; ``mask`` is 1 on the object."""
        inputs = torch.cat([image, mask[:, None], object_coordinates(mask)], 1)
        return torch.nn.functional.pixel_shuffle(self.head(self.features(inputs)), FOLDED_PX)


def object_coordinates(mask: Float[Tensor, "b h w"]) -> Float[Tensor, "b 2 h w"]:
    """X and y from the middle of each mask, 0.5 there; those of an empty one are of the image."""
    axes = pixel_coordinates(mask[:, None])
    share = mask[:, None] + LEAST_SHARE
    share = share / share.sum((2, 3), keepdim=True)
    middle = (share * axes).sum((2, 3), keepdim=True)
    variance = (share * (axes - middle).square()).sum((1, 2, 3), keepdim=True)
    return ((axes - middle) / (REACH * variance.sqrt())).clamp(-1, 1) / 2 + 0.5

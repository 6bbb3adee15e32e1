"""The size at which the object mask sees an image: small objects need small cells.

Axes: ``n c h w`` images, ``n r h w`` logits.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks import resize
from diff4splat.models.image_unet.cells import MULTIPLE_PX

ENLARGEMENT = 1.5
"""Of the image's sides. Validation worlds of 128 px: docs/log/object-mask-backbone.md."""


def enlarged(image: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h2 w2"]:
    """The image with larger sides, multiples of those that the network takes."""
    return resize.enlarged(image, ENLARGEMENT, MULTIPLE_PX)


def reduced(
    logits: Float[Tensor, "n r h2 w2"], size_px: tuple[int, int]
) -> Float[Tensor, "n r h w"]:
    """Logits of an enlarged image at the size that it had."""
    return torch.nn.functional.interpolate(logits.float(), size_px, mode="bilinear", antialias=True)

"""Resizing of feature maps."""

import torch
from jaxtyping import Float
from torch import Tensor


def upsample_bilinear(maps: Float[Tensor, "n c h w"], scale: int) -> Float[Tensor, "n c h2 w2"]:
    """Bilinear upsampling in space by a whole factor."""
    if scale == 1:
        return maps
    return torch.nn.functional.interpolate(
        maps, scale_factor=scale, mode="bilinear", align_corners=False
    )

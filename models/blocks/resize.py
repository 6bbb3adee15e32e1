"""Resizing of feature maps."""

import torch
from jaxtyping import Float
from torch import Tensor


def nearest_multiple(length: float, multiple: int) -> int:
    """The nearest multiple that is not 0."""
    return multiple * max(round(length / multiple), 1)


def enlarged(
    image: Float[Tensor, "n c h w"], factor: float, multiple_px: int
) -> Float[Tensor, "n c h2 w2"]:
    """An image in [0, 1], bicubic, with sides that are multiples near ``factor`` of its own."""
    sides = [nearest_multiple(factor * side, multiple_px) for side in image.shape[-2:]]
    larger = torch.nn.functional.interpolate(image, sides, mode="bicubic", align_corners=False)
    return larger.clamp(0, 1)


def upsample_bilinear(maps: Float[Tensor, "n c h w"], scale: int) -> Float[Tensor, "n c h2 w2"]:
    """Bilinear upsampling in space by a whole factor."""
    if scale == 1:
        return maps
    return torch.nn.functional.interpolate(
        maps, scale_factor=scale, mode="bilinear", align_corners=False
    )


def upsample_nearest(maps: Float[Tensor, "n c h w"], scale: int) -> Float[Tensor, "n c h2 w2"]:
    """Each pixel repeated in space by a whole factor."""
    return torch.nn.functional.interpolate(maps, scale_factor=scale, mode="nearest")

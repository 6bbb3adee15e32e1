"""How much of an image is detail, that a smaller or softer copy loses."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

LEAST = 1e-7
"""Below this an image is flat, and errors of rounding count."""


def image_detail(rgb: Float[Tensor, "h w 3"]) -> float:
    """Mean square of what the image loses at half of its size."""
    return lost_at(rgb, (max(rgb.shape[0] // 2, 1), max(rgb.shape[1] // 2, 1)))


def lost_at(rgb: Float[Tensor, "h w 3"], size_px: tuple[int, int]) -> float:
    """Mean square difference to the image at (height, width), enlarged again."""
    image = rgb.movedim(-1, 0)[None].float()
    error = (resized(resized(image, size_px), image.shape[2:]) - image).square().mean()
    return max(float(error), LEAST)


def resized(image: Float[Tensor, "b c h w"], size: Sequence[int]) -> Tensor:
    """Bicubic, averaging where it shrinks; colours stay in [0, 1]."""
    scaled = torch.nn.functional.interpolate(
        image, tuple(size), mode="bicubic", align_corners=False, antialias=True
    )
    return scaled.clamp(0, 1)

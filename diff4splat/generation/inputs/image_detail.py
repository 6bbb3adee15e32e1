"""How much of an image is detail, that a smaller or softer copy loses."""

import torch
from jaxtyping import Float
from torch import Tensor

LEAST = 1e-7
"""Below this an image is flat, and errors of rounding count."""


def image_detail(rgb: Float[Tensor, "h w 3"]) -> float:
    """Mean square difference to the image at half of its size, enlarged again."""
    image = rgb.movedim(-1, 0)[None].float()
    half = [max(side // 2, 1) for side in image.shape[2:]]
    error = (resized(resized(image, half), image.shape[2:]) - image).square().mean()
    return max(float(error), LEAST)


def resized(image: Float[Tensor, "b c h w"], size: list[int] | torch.Size) -> Tensor:
    """Bicubic, averaging where it shrinks; colours stay in [0, 1]."""
    scaled = torch.nn.functional.interpolate(
        image, tuple(size), mode="bicubic", align_corners=False, antialias=True
    )
    return scaled.clamp(0, 1)

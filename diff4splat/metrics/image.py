"""How far an image is from another one.

Axes: ``*b`` images, ``h w c`` the three axes of an image in any order. RGB in [0, 1].
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError


def mse(
    image: Float[Tensor, "*b h w c"], reference: Float[Tensor, "*b h w c"]
) -> Float[Tensor, "*b"]:
    """Mean squared error of each image, in float32 or better.

    Raises:
        ShapeError: the shapes differ, or there is no pixel.
    """
    if image.shape != reference.shape:
        raise ShapeError(f"image: expected {tuple(reference.shape)}, got {tuple(image.shape)}")
    if image.ndim < 3 or 0 in image.shape[-3:]:
        raise ShapeError(f"image: expected three axes of at least 1, got {tuple(image.shape)}")
    dtype = torch.promote_types(torch.promote_types(image.dtype, reference.dtype), torch.float32)
    return (image.to(dtype) - reference.to(dtype)).square().mean((-3, -2, -1))


def psnr(
    image: Float[Tensor, "*b h w c"], reference: Float[Tensor, "*b h w c"]
) -> Float[Tensor, "*b"]:
    """Peak signal-to-noise ratio of each image in dB, for a peak of 1; inf if identical.

    Raises:
        ShapeError: the shapes differ, or there is no pixel.
    """
    return -10 * mse(image, reference).log10()

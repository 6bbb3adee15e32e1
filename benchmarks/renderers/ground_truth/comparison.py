"""How far an image and its gradients are from the truth, and whether that is right.

Axes: ``p`` sampled pixels. PSNR has peak 1. A gradient vanishes when its norm is below 1e-6 of the
largest parameter's; there only rounding is left to compare, so nothing is.
"""

import math
from collections.abc import Sequence
from dataclasses import fields

import torch
from jaxtyping import Float
from records import GradientError, ImageError
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians
from ground_truth.pixel_samples import Truth

HALF_LEVEL = 0.5 / 255
RTOL, ATOL = 1e-2, 1e-4
"""Bound on one element of a gradient; ATOL is relative to the largest element."""
VANISHING = 1e-6
LEAST_PSNR_DB, MOST_GRADIENT_ERROR = 60.0, 1e-2
"""What counts as right: the eye sees nothing, and training steps go the same way."""


def image_error(rgb: Float[Tensor, "h w 3"], truth: Truth) -> ImageError:
    """The image at the pixels that were sampled."""
    error = rgb.flatten(0, 1)[truth.index].double() - truth.pixels.rgb
    mean_square = error.square().mean()
    return ImageError(
        psnr_db=float(-10 * torch.log10(mean_square)),
        max_error=float(error.abs().max()),
        wrong=int((error.abs().amax(1) > HALF_LEVEL).sum()),
        bias=float(error.mean()),
        doubtful=int(truth.pixels.doubtful.sum()),
        sampled=len(error),
    )


def gradient_errors(found: Gaussians, truth: Gaussians) -> tuple[GradientError, ...]:
    """Every parameter's gradient against the true one."""
    names = [field.name for field in fields(Gaussians)]
    largest = max(float(getattr(truth, name).norm()) for name in names)
    return tuple(
        gradient_error(
            name, getattr(found, name).double(), getattr(truth, name), VANISHING * largest
        )
        for name in names
    )


def gradient_error(
    parameter: str, found: Float[Tensor, "*s"], truth: Float[Tensor, "*s"], vanishing: float
) -> GradientError:
    """One parameter's gradient; a norm up to ``vanishing`` is not compared."""
    norm = float(truth.norm())
    if norm <= vanishing:
        return GradientError(
            parameter=parameter, relative_l2=None, cosine=None, bias=None, worst=None
        )
    error = found - truth
    bound = ATOL * truth.abs().max() + RTOL * truth.abs()
    return GradientError(
        parameter=parameter,
        relative_l2=float(error.norm()) / norm,
        cosine=float((found * truth).sum() / (found.norm() * norm)),
        bias=float(error.sum() / truth.abs().sum()),
        worst=float((error.abs() / bound).max()),
    )


def worst_gradient(errors: Sequence[GradientError]) -> GradientError | None:
    """The parameter with the largest relative error; one that is not finite is the largest."""
    compared = [error for error in errors if error.relative_l2 is not None]
    return max(compared, key=_size, default=None)


def _size(error: GradientError) -> float:
    size = error.relative_l2
    return math.inf if size is None or math.isnan(size) else size


def verdict(image: ImageError | None, errors: Sequence[GradientError]) -> str:
    """ "right", or what is not."""
    wrong = []
    if image is not None and not image.psnr_db >= LEAST_PSNR_DB:
        wrong.append("picture")
    wrong += [
        error.parameter
        for error in errors
        if error.relative_l2 is not None and not _size(error) <= MOST_GRADIENT_ERROR
    ]
    return f"wrong: {', '.join(wrong)}" if wrong else "right"

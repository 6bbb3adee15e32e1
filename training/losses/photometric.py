"""Rendered images against true ones.

Axes: ``b`` batch, ``k`` images of an element (views, times), ``h w`` pixels. RGB in [0, 1].

    loss = MSE + λ_p · perceptual distance,   λ_p = 0.5  (Diff4Splat, arXiv 2511.00503, losses)

with LPIPS as distance in the paper, and here whatever ``PerceptualFeatures`` is handed in. Both
terms leave out what is not ``valid``; an element without a valid pixel gives 0.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike, require_mask
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.masked import masked_mean
from diff4splat.metrics.perceptual import perceptual_distance


def squared_error(
    image: Float[Tensor, "b k h w 3"],
    reference: Float[Tensor, "b k h w 3"],
    valid: Bool[Tensor, "b k h w"] | None = None,
) -> Float[Tensor, " b"]:
    """Mean over the valid pixels of an element.

    Raises:
        ShapeError: the shapes differ.
    """
    image, reference, valid = _known(image, reference, valid)
    error = (image - reference).square().mean(-1)
    return masked_mean(error.flatten(1), valid.flatten(1))


def perceptual_error(
    image: Float[Tensor, "b k h w 3"],
    reference: Float[Tensor, "b k h w 3"],
    features: PerceptualFeatures,
    valid: Bool[Tensor, "b k h w"] | None = None,
) -> Float[Tensor, " b"]:
    """Mean distance over an element's images; invalid pixels show the reference in both.

    Raises:
        ShapeError: the shapes differ.
    """
    image, reference, valid = _known(image, reference, valid)
    distance = perceptual_distance(image, reference, features).flatten(1)
    return masked_mean(distance, valid.flatten(-2).any(-1).flatten(1))


def _known(image: Tensor, reference: Tensor, valid: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
    """Widened images that agree in invalid pixels, and the mask."""
    require_alike("image", image, reference)
    image, reference = promote(image, reference)
    if valid is None:
        return image, reference, torch.ones_like(image[..., 0], dtype=torch.bool)
    require_mask(valid, image.shape[:-1])
    # Truth may be NaN where it is invalid: there, both are 0 then.
    known = valid[..., None]
    reference = torch.where(known | reference.isfinite(), reference, 0.0)
    return torch.where(known, image, reference), reference, valid

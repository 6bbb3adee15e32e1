"""Rendered pictures against true ones.

Axes: ``b`` batch, ``k`` pictures of an element (views, times), ``h w`` pixels. RGB in [0, 1].

    loss = MSE + λ_p · perceptual distance,   λ_p = 0.5  (Diff4Splat, arXiv 2511.00503, losses)

with LPIPS as distance in the paper, and here whatever ``PerceptualFeatures`` is handed in.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.metrics.checks import require_alike, require_mask, widen
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.masked import masked_mean
from diff4splat.metrics.perceptual import perceptual_distance


def photometric(
    image: Float[Tensor, "b k h w 3"],
    reference: Float[Tensor, "b k h w 3"],
    *,
    features: PerceptualFeatures | None = None,
    perceptual_weight: float = 0.0,
    valid: Bool[Tensor, "b k h w"] | None = None,
) -> Float[Tensor, " b"]:
    """Squared error over the valid pixels of an element, plus the weighted perceptual distance.

    For the distance, invalid pixels show the reference in both pictures. Weight 0 never calls the
    network; an element without a valid pixel gives 0.

    Raises:
        ConfigError: a weight above 0 without features, or below 0.
        ShapeError: the shapes differ.
    """
    require_alike("image", image, reference)
    _require_features(features, perceptual_weight)
    image, reference = widen(image, reference)
    if valid is None:
        valid = torch.ones_like(image[..., 0], dtype=torch.bool)
    require_mask(valid, image.shape[:-1])
    image, reference = _hide_invalid(image, reference, valid)
    error = (image - reference).square().mean(-1)
    loss = masked_mean(error.flatten(1), valid.flatten(1))
    if features is None or perceptual_weight == 0:
        return loss
    distance = perceptual_distance(image, reference, features).flatten(1)
    seen = valid.flatten(-2).any(-1).flatten(1)
    return loss + perceptual_weight * masked_mean(distance, seen)


def _hide_invalid(image: Tensor, reference: Tensor, valid: Tensor) -> tuple[Tensor, Tensor]:
    # Truth may be NaN where it is invalid: there, both are 0 then.
    known = valid[..., None]
    reference = torch.where(known | reference.isfinite(), reference, 0.0)
    return torch.where(known, image, reference), reference


def _require_features(features: PerceptualFeatures | None, weight: float) -> None:
    if not weight >= 0:
        raise ConfigError(f"perceptual weight: expected 0 or more, got {weight}")
    if weight > 0 and features is None:
        raise ConfigError(
            "perceptual weight: expected features for a weight above 0, got none; "
            "pass load_features(None) for the stand-in"
        )

"""How far tracked motion is from the true one.

Axes: ``*b`` sets of points, ``n`` points, ``d`` = 2 (pixels) or 3 (scene units). Points that are
not ``valid`` do not count and may hold NaN; a set to which a question does not apply is NaN: leave
it out of means with ``nanmean``.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.metrics.checks import require_alike, require_mask, widen
from diff4splat.metrics.masked import hidden_as_zero, mean_or_nan


def track_endpoint_error(
    predicted: Float[Tensor, "*b n d"],
    truth: Float[Tensor, "*b n d"],
    valid: Bool[Tensor, "*b n"],
) -> Float[Tensor, "*b"]:
    """Mean distance between predicted and true points, or displacements, in their own unit.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("predicted", predicted, truth)
    require_mask(valid, truth.shape[:-1])
    predicted, truth = (hidden_as_zero(part, valid[..., None]) for part in widen(predicted, truth))
    apart = torch.linalg.vector_norm(predicted - truth, dim=-1)
    return mean_or_nan(apart, valid)


def share_moving(
    displacement: Float[Tensor, "*b n d"], valid: Bool[Tensor, "*b n"], threshold: float
) -> Float[Tensor, "*b"]:
    """Share of points that go further than ``threshold``.

    Raises:
        ConfigError: a negative threshold.
        ShapeError: the shapes differ.
    """
    _require_threshold(threshold)
    require_mask(valid, displacement.shape[:-1])
    (displacement,) = widen(displacement)
    length = torch.linalg.vector_norm(hidden_as_zero(displacement, valid[..., None]), dim=-1)
    return mean_or_nan((length > threshold).to(length.dtype), valid)


def sign_agreement(
    predicted: Float[Tensor, "*b n d"],
    truth: Float[Tensor, "*b n d"],
    valid: Bool[Tensor, "*b n"],
    direction: Float[Tensor, " d"],
    threshold: float = 0.0,
) -> Float[Tensor, "*b"]:
    """Share of points truly moving along ``direction`` that are predicted to go the same way.

    Points count whose true component along it exceeds ``threshold`` in size; standing still is not
    agreement.

    Raises:
        ConfigError: a negative threshold, or a direction of length 0.
        ShapeError: the shapes differ.
    """
    require_alike("predicted", predicted, truth)
    require_mask(valid, truth.shape[:-1])
    if direction.shape != truth.shape[-1:]:
        want, got = tuple(truth.shape[-1:]), tuple(direction.shape)
        raise ShapeError(f"direction: expected {want}, got {got}")
    _require_threshold(threshold)
    length = float(torch.linalg.vector_norm(direction))
    if not (math.isfinite(length) and length > 0):
        raise ConfigError(f"direction: expected a length above 0, got {length}")
    predicted, truth, direction = widen(predicted, truth, direction / length)
    own, true = (
        (hidden_as_zero(part, valid[..., None]) * direction).sum(-1) for part in (predicted, truth)
    )
    return mean_or_nan((own.sign() == true.sign()).to(true.dtype), valid & (true.abs() > threshold))


def _require_threshold(threshold: float) -> None:
    if not (math.isfinite(threshold) and threshold >= 0):
        raise ConfigError(f"threshold: expected 0 or more, got {threshold}")

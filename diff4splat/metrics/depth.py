"""How far a depth map is from another one.

Axes: ``*b`` maps, ``h w`` pixels. Depth is z in any unit; pixels that are not ``valid`` do not
count and may hold NaN.

    correlation        Cov(d, d*) / (σ(d) σ(d*))             scale and shift do not matter
    relative error     mean |d − d*| / d*                    "AbsRel"

(Eigen et al., arXiv 1406.2283, §4.) A map that says nothing (no valid pixel, or no variation to
correlate) is NaN: leave it out of means with ``nanmean``.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike, require_mask
from diff4splat.metrics.masked import masked_mean, mean_or_nan, zero_masked

FLATTEST = 1e-6
"""Standard deviation, as a share of the mean size, below which a map has no variation."""


def depth_pearson(
    depth: Float[Tensor, "*b h w"], truth: Float[Tensor, "*b h w"], valid: Bool[Tensor, "*b h w"]
) -> Float[Tensor, "*b"]:
    """Pearson correlation of each map, −1 to 1; NaN where either has no variation.

    Raises:
        ShapeError: the shapes differ.
    """
    depth, truth, keep = _flat(depth, truth, valid)
    depth, truth = _centered(depth, keep), _centered(truth, keep)
    own, true = (masked_mean(part.square(), keep).sqrt() for part in (depth, truth))
    varied = (own > FLATTEST) & (true > FLATTEST)
    correlation = masked_mean(depth * truth, keep) / torch.where(varied, own * true, 1.0)
    return torch.where(varied, correlation.clamp(-1, 1), math.nan)


def relative_error(
    depth: Float[Tensor, "*b h w"], truth: Float[Tensor, "*b h w"], valid: Bool[Tensor, "*b h w"]
) -> Float[Tensor, "*b"]:
    """Mean error of each map in units of the true depth, which must be above 0 where valid.

    Raises:
        ShapeError: the shapes differ.
    """
    depth, truth, keep = _flat(depth, truth, valid)
    return mean_or_nan((depth - truth).abs() / torch.where(keep, truth, 1.0), keep)


def _flat(depth: Tensor, truth: Tensor, valid: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Pixels on one axis, hidden ones 0."""
    require_alike("depth", depth, truth)
    require_mask(valid, truth.shape)
    keep = valid.flatten(-2)
    depth, truth = promote(depth.flatten(-2), truth.flatten(-2))
    return zero_masked(depth, keep), zero_masked(truth, keep), keep


def _centered(depth: Tensor, keep: Tensor) -> Tensor:
    """Less the mean, in units of the mean size."""
    size = masked_mean(depth.abs(), keep)[..., None]
    depth = depth / torch.where(size > 0, size, 1.0)
    return zero_masked(depth - masked_mean(depth, keep)[..., None], keep)

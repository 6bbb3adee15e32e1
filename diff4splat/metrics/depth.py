"""How far a depth map is from another one.

Axes: ``*b`` maps, ``h w`` pixels. Depth is z in any unit; pixels that are not ``valid`` do not
count and may hold NaN.

    correlation        Cov(d, d*) / (σ(d) σ(d*))             scale and shift do not matter
    relative error     mean |d − d*| / d*                    "AbsRel"
    share within r     share of max(d / d*, d* / d) < r      "δ < 1.25" for r = 1.25

(Eigen et al., arXiv 1406.2283, §4.) Errors of depth that is known up to scale, or up to scale and
shift, are those after ``align_depth``; a table must name the alignment. A map that says nothing
(no valid pixel, or no variation to correlate) is NaN: leave it out of means with ``nanmean``.
"""

import math
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.metrics.checks import require_alike, require_mask, widen
from diff4splat.metrics.masked import hidden_as_zero, masked_mean, mean_or_nan

Alignment = Literal["none", "median", "affine"]
"""Nothing; the ratio of medians; least-squares scale and shift. Each map by itself."""
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


def share_within(
    depth: Float[Tensor, "*b h w"],
    truth: Float[Tensor, "*b h w"],
    valid: Bool[Tensor, "*b h w"],
    ratio: float = 1.25,
) -> Float[Tensor, "*b"]:
    """Share of each map's pixels that are less than ``ratio`` times too far or too near.

    Raises:
        ConfigError: the ratio is not above 1.
        ShapeError: the shapes differ.
    """
    if not ratio > 1:
        raise ConfigError(f"ratio: expected a number above 1, got {ratio}")
    depth, truth, keep = _flat(depth, truth, valid)
    # As products: a depth of 0 is far off then, and nothing is divided by it.
    within = (depth < ratio * truth) & (truth < ratio * depth)
    return mean_or_nan(within.to(depth.dtype), keep)


def align_depth(
    depth: Float[Tensor, "*b h w"],
    truth: Float[Tensor, "*b h w"],
    valid: Bool[Tensor, "*b h w"],
    alignment: Alignment,
) -> Float[Tensor, "*b h w"]:
    """The depth maps in the truth's unit, as far as ``alignment`` goes.

    Maps that cannot be aligned (no valid pixel, a median of 0) are only left as they are; a flat
    one gets the best shift.

    Raises:
        ConfigError: unknown alignment.
        ShapeError: the shapes differ.
    """
    rules = {"none": _unchanged, "median": _median_scale, "affine": _least_squares}
    if alignment not in rules:
        raise ConfigError(f"alignment: expected one of {', '.join(rules)}, got {alignment!r}")
    scale, shift = rules[alignment](*_flat(depth, truth, valid))
    return widen(depth)[0] * scale[..., None, None] + shift[..., None, None]


def _unchanged(depth: Tensor, truth: Tensor, keep: Tensor) -> tuple[Tensor, Tensor]:
    zeros = torch.zeros_like(truth.sum(-1))
    return zeros + 1, zeros


def _median_scale(depth: Tensor, truth: Tensor, keep: Tensor) -> tuple[Tensor, Tensor]:
    """Ratio of the lower medians."""
    one, zero = _unchanged(depth, truth, keep)
    if keep.shape[-1] == 0:
        return one, zero
    own, true = (torch.where(keep, part, math.nan).nanmedian(-1).values for part in (depth, truth))
    usable = (own > 0) & true.isfinite()
    return torch.where(usable, true / torch.where(usable, own, 1.0), one), zero


def _least_squares(depth: Tensor, truth: Tensor, keep: Tensor) -> tuple[Tensor, Tensor]:
    own_mean, true_mean = masked_mean(depth, keep), masked_mean(truth, keep)
    own = hidden_as_zero(depth - own_mean[..., None], keep)
    true = hidden_as_zero(truth - true_mean[..., None], keep)
    variance = masked_mean(own.square(), keep)
    varied = variance > (FLATTEST * own_mean).square()
    scale = masked_mean(own * true, keep) / torch.where(varied, variance, 1.0)
    scale = torch.where(varied, scale, 1.0)
    return scale, true_mean - scale * own_mean


def _flat(depth: Tensor, truth: Tensor, valid: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Pixels on one axis, hidden ones 0."""
    require_alike("depth", depth, truth)
    require_mask(valid, truth.shape)
    keep = valid.flatten(-2)
    depth, truth = widen(depth.flatten(-2), truth.flatten(-2))
    return hidden_as_zero(depth, keep), hidden_as_zero(truth, keep), keep


def _centered(depth: Tensor, keep: Tensor) -> Tensor:
    """Less the mean, in units of the mean size."""
    size = masked_mean(depth.abs(), keep)[..., None]
    depth = depth / torch.where(size > 0, size, 1.0)
    return hidden_as_zero(depth - masked_mean(depth, keep)[..., None], keep)

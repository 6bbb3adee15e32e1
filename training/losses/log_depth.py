"""Logarithm of the depth of single images against the truth, wherever a truth is known.

Axes: ``n`` images, ``h w`` pixels. With the difference R = log D̂ − log D and V its valid pixels

    gradient = Σ_k mean_V (|R_{x + 2^k} − R_x| + |R_{y + 2^k} − R_y|),   k = 0 … SCALES − 1

(the gradient term of MiDaS, arXiv 1907.01341, equation 11, at strides instead of resolutions): an
edge of depth costs where it is, however far everything else is off. With a predicted scale s

    uncertainty = mean_V (|R − median_V R| / s + log s)

(a Laplace likelihood, Kendall and Gal 2017).
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.masked import masked_mean

SCALES = 4
LEAST_PIXELS = 16
"""An image with fewer pixels of known depth has no scale of its own."""


def rescale_median(
    depth: Float[Tensor, "n h w"], median: float
) -> tuple[Float[Tensor, "n h w"], Bool[Tensor, "n h w"]]:
    """Depth in units in which each image's median is ``median``, and where it is known.

    1 where nothing is known: nowhere in an image with next to no depth.
    """
    known = (depth > 0) & depth.isfinite()
    known = known & (known.flatten(1).sum(1) >= LEAST_PIXELS)[:, None, None]
    middle = torch.where(known, depth, torch.nan).flatten(1).nanmedian(1).values
    scaled = depth * (median / middle)[:, None, None]
    return torch.where(known, scaled, 1.0), known


def gradient_error(
    difference: Float[Tensor, "n h w"], known: Bool[Tensor, "n h w"]
) -> Float[Tensor, " n"]:
    """Steps of ``difference`` between known pixels, over all scales."""
    total = difference.new_zeros(len(difference))
    for scale in range(SCALES):
        for axis in (-1, -2):
            total = total + _steps(difference, known, axis, 1 << scale)
    return total


def inverse_depth_error(
    log_depth: Float[Tensor, "n h w"],
    truth: Float[Tensor, "n h w"],
    known: Bool[Tensor, "n h w"],
    unit: float,
) -> Float[Tensor, " n"]:
    """Mean |unit / depth − unit / truth| over known pixels."""
    error = unit * (-log_depth).exp() - unit / truth
    return masked_mean(error.abs().flatten(1), known.flatten(1))


def laplace_error(
    difference: Float[Tensor, "n h w"],
    log_scale: Float[Tensor, "n h w"],
    known: Bool[Tensor, "n h w"],
) -> Float[Tensor, " n"]:
    """Negative log likelihood of ``difference``, which gets no gradient, but for a constant."""
    middle = torch.where(known, difference, torch.nan).flatten(1).nanmedian(1).values
    error = (difference - middle[:, None, None]).abs().detach().where(known, 0.0)
    value = error * (-log_scale).exp() + log_scale
    return masked_mean(value.flatten(1), known.flatten(1))


def _steps(difference: Tensor, known: Tensor, axis: int, stride: int) -> Float[Tensor, " n"]:
    length = difference.shape[axis] - stride
    if length < 1:
        return difference.new_zeros(len(difference))
    before, after = (difference.narrow(axis, start, length) for start in (0, stride))
    pairs = known.narrow(axis, 0, length) & known.narrow(axis, stride, length)
    return masked_mean((after - before).abs().flatten(1), pairs.flatten(1))

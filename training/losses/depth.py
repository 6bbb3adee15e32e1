"""Rendered depth against true depth, up to scale and shift, and its smoothness.

Axes: ``b`` batch, ``k`` maps of an element, ``h w`` pixels. Depth is z, 0 where nothing is known.

    correlation = 1 − Cov(D̂, D) / (σ(D̂) σ(D))       per map, over its valid pixels
    smoothness  = mean |D̂_{x+1} − D̂_x| + mean |D̂_{y+1} − D̂_y|,   of D̂ / mean D̂

(Diff4Splat, arXiv 2511.00503, losses: Pearson on rendered depth, and ‖∇D̂‖₁.) Dividing by the mean
is ours, as in Monodepth2 (arXiv 1806.01260, §3): otherwise the weight would depend on the unit of
length, and the whole scene would be pulled towards the camera.

Maps whose truth says nothing (too few valid pixels, or nearly constant) are left out; an element
without any other gives 0 with zero gradient. A *rendered* map that is nearly constant stays in: an
untrained model renders a plane, and must learn to leave it. σ(D̂) is then held at FLATTEST of the
mean depth, which gives the loss 1 and a bounded gradient that points to the truth.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike, require_mask
from diff4splat.metrics.masked import masked_mean, zero_masked

LEAST_PIXELS = 16
"""Fewer valid pixels correlate by accident."""
FLATTEST = 1e-3
"""Standard deviation, as a share of the mean depth, below which a map counts as constant."""
LEAST_MEAN = 1e-6
"""Mean depth below which smoothness is no longer divided by it."""


def depth_correlation(
    rendered: Float[Tensor, "b k h w"],
    truth: Float[Tensor, "b k h w"],
    valid: Bool[Tensor, "b k h w"] | None = None,
) -> Float[Tensor, " b"]:
    """1 − Pearson correlation over the valid pixels, mean over an element's usable maps; 0 to 2.

    Without ``valid``, pixels with a positive, finite truth count.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("rendered", rendered, truth)
    if valid is None:
        valid = (truth > 0) & truth.isfinite()
    require_mask(valid, truth.shape)
    rendered, truth, keep = *promote(rendered.flatten(-2), truth.flatten(-2)), valid.flatten(-2)
    truth_size = _size(truth, keep)
    # Correlation does not change with the unit; in these units nothing over- or underflows.
    rendered_size = torch.maximum(_size(rendered, keep), FLATTEST * truth_size)
    rendered, truth = _centered(rendered, rendered_size, keep), _centered(truth, truth_size, keep)
    covariance = masked_mean(rendered * truth, keep)
    correlation = covariance / (_deviation(rendered, keep) * _deviation(truth, keep))
    known = (keep.sum(-1) >= LEAST_PIXELS) & (_deviation(truth, keep) > FLATTEST)
    return masked_mean(1 - correlation, known)


def depth_log_error(
    depth: Float[Tensor, "b k h w"], truth: Float[Tensor, "b k h w"]
) -> Float[Tensor, " b"]:
    """Mean |log depth − log truth| over an element's pixels with a positive, finite truth.

    Raises:
        ShapeError: the shapes differ.
    """
    require_alike("depth", depth, truth)
    valid = (truth > 0) & truth.isfinite()
    depth, truth = promote(depth, torch.where(valid, truth, 1.0))
    error = (depth.log() - truth.log()).abs()
    return masked_mean(error.flatten(1), valid.flatten(1))


def depth_smoothness(
    rendered: Float[Tensor, "b k h w"],
    valid: Bool[Tensor, "b k h w"] | None = None,
) -> Float[Tensor, " b"]:
    """Total variation of depth over its mean, between valid neighbours; mean over an element.

    Raises:
        ShapeError: the shapes differ.
    """
    (rendered,) = promote(rendered)
    if valid is None:
        valid = torch.ones_like(rendered, dtype=torch.bool)
    require_mask(valid, rendered.shape)
    depth = zero_masked(rendered, valid)
    mean = masked_mean(depth.abs().flatten(-2), valid.flatten(-2))[..., None, None]
    depth = depth / mean.clamp(min=LEAST_MEAN)
    return _variation(depth, valid, -1) + _variation(depth, valid, -2)


def _variation(depth: Tensor, valid: Tensor, axis: int) -> Tensor:
    """Mean absolute step along one axis."""
    before, after = _neighbours(depth, axis)
    steps = (after - before).abs()
    before, after = _neighbours(valid, axis)
    return masked_mean(steps.flatten(1), (before & after).flatten(1))


def _neighbours(maps: Tensor, axis: int) -> tuple[Tensor, Tensor]:
    turned = maps.transpose(axis, -1)
    return turned[..., :-1], turned[..., 1:]


def _size(depth: Tensor, keep: Tensor) -> Tensor:
    """Mean absolute depth, a constant to the gradient."""
    return masked_mean(depth.detach().abs(), keep)[..., None]


def _centered(depth: Tensor, unit: Tensor, keep: Tensor) -> Tensor:
    depth = zero_masked(depth, keep) / torch.where(unit > 0, unit, 1.0)
    return zero_masked(depth - masked_mean(depth, keep)[..., None], keep)


def _deviation(centered: Tensor, keep: Tensor) -> Tensor:
    """Standard deviation, held at FLATTEST from below."""
    return masked_mean(centered.square(), keep).clamp(min=FLATTEST**2).sqrt()

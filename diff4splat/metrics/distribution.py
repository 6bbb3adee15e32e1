"""How far two sets of features are from each other as distributions.

Axes: ``n m`` samples, ``d`` features. Everything is computed in float64.

    Fréchet  ‖μ₁ − μ₂‖² + tr S₁ + tr S₂ − 2 tr (S₁ S₂)^½            (Heusel et al. 2017)
    kernel   mean_{i≠j} k(x_i, x_j) + mean_{i≠j} k(y_i, y_j) − 2 mean_{ij} k(x_i, y_j),
             k(x, y) = (x·y / d + 1)³                                 (Bińkowski et al. 2018)

Samples that come in pairs, such as a generated video and the true one of the same scene, are not
independent: i ≠ j then holds in the last mean too (Gretton et al. 2012, lemma 6).

With S = AᵀA the trace of the root is the sum of singular values of A₁A₂ᵀ: no root of a singular
matrix is taken, so few samples of many features are as exact as many. The Fréchet distance of few
samples is too large all the same, by an amount that depends on their number; the kernel distance is
unbiased, and can be below 0 for equal distributions.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError, ShapeError

LEAST_SAMPLES = 2
DEGREE = 3


def frechet_distance(one: Float[Tensor, "n d"], other: Float[Tensor, "m _d"]) -> float:
    """Fréchet distance of the normal distributions with the moments of both sets; at least 0.

    Raises:
        ShapeError: fewer than two samples, or another number of features.
        InputError: a value is not finite.
    """
    one, other = _checked(one, other)
    means = (one.mean(0) - other.mean(0)).square().sum()
    factors = _factor(one), _factor(other)
    traces = factors[0].square().sum() + factors[1].square().sum()
    roots = torch.linalg.svdvals(factors[0] @ factors[1].mT).sum()
    return max(float(means + traces - 2 * roots), 0.0)


def kernel_distance(
    one: Float[Tensor, "n d"], other: Float[Tensor, "m _d"], *, paired: bool = False
) -> float:
    """Unbiased squared maximum mean discrepancy with the cubic kernel.

    ``paired``: sample i of both belongs together.

    Raises:
        ShapeError, InputError: as ``frechet_distance``; unequal numbers of paired samples.
    """
    one, other = _checked(one, other)
    if paired and len(one) != len(other):
        raise ShapeError(f"features: expected as many pairs, got {len(one)} and {len(other)}")
    within = _mean_off_diagonal(_kernel(one, one)) + _mean_off_diagonal(_kernel(other, other))
    between = _kernel(one, other)
    return float(within - 2 * (_mean_off_diagonal(between) if paired else between.mean()))


def _factor(samples: Float[Tensor, "n d"]) -> Float[Tensor, "k d"]:
    """A with AᵀA the covariance, of at most as many rows as columns."""
    centered = (samples - samples.mean(0)) / (len(samples) - 1) ** 0.5
    if len(samples) <= samples.shape[1]:
        return centered
    return torch.linalg.qr(centered, mode="r").R


def _kernel(one: Float[Tensor, "n d"], other: Float[Tensor, "m d"]) -> Float[Tensor, "n m"]:
    return (one @ other.mT / one.shape[1] + 1) ** DEGREE


def _mean_off_diagonal(gram: Float[Tensor, "n n"]) -> Tensor:
    count = len(gram)
    return (gram.sum() - gram.diagonal().sum()) / (count * (count - 1))


def _checked(one: Tensor, other: Tensor) -> tuple[Tensor, Tensor]:
    for samples in (one, other):
        fits = samples.ndim == 2 and samples.shape[1] == one.shape[-1] > 0
        if not fits or len(samples) < LEAST_SAMPLES:
            raise ShapeError(
                f"features: expected at least {LEAST_SAMPLES} samples of equally many features, "
                f"got {tuple(one.shape)} and {tuple(other.shape)}"
            )
        if not bool(samples.isfinite().all()):
            raise InputError("features: expected finite numbers, got NaN or infinity")
    return one.detach().double().cpu(), other.detach().double().cpu()

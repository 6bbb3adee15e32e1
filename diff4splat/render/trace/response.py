"""Where a ray comes closest to a Gaussian, and how much it sees there, in PyTorch.

Axes: ``n`` Gaussians, ``p`` pairs (ray, Gaussian). With W = S⁻¹ Rᵀ the Gaussian is a unit ball, the
ray starts at g_o = W (origin - mean) and runs along g_d = W direction, and (3DGRT, §4.1)

    τ = -(g_o · g_d) / (g_d · g_d)        D² = |g_o + τ g_d|²

A distance in standard deviations of 10⁵ squared still has ten digits in float64, so that is the
arithmetic here whatever the inputs are.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

THINNEST = 1e-12
"""Scales below this count as this, in scene units."""
_QUARTIC = 18.0


def whitening(gaussians: Gaussians) -> Float[Tensor, "n 3 3"]:
    """W = S⁻¹ Rᵀ in float64."""
    scales = gaussians.scales.double().abs().clamp_min(THINNEST)
    return quaternion.to_matrix(gaussians.quats.double()).mT / scales[:, :, None]


def closest(
    whiten: Float[Tensor, "*#p 3 3"],
    offset: Float[Tensor, "*#p 3"],
    direction: Float[Tensor, "*#p 3"],
) -> tuple[Float[Tensor, "*p"], Float[Tensor, "*p"]]:
    """(τ, D²) of rays that start at ``offset`` from the mean."""
    start = torch.einsum("...ij,...j->...i", whiten, offset)
    along = torch.einsum("...ij,...j->...i", whiten, direction)
    distance = -(start * along).sum(-1) / along.square().sum(-1)
    return distance, (start + distance[..., None] * along).square().sum(-1)


def exponent(squared: Float[Tensor, "*p"], settings: TraceSettings) -> Float[Tensor, "*p"]:
    """Logarithm of the response at D²."""
    if settings.kernel_degree == 2:
        return -0.5 * squared
    return -squared.square() / _QUARTIC

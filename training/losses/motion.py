"""Displacements of tracked points against the true ones.

Axes: ``b`` batch, ``*k`` pairs of times, ``n`` tracked points, 3 for (x, y, z) in scene units. Both
displacements are from the time a point was found at to the queried time, in the world frame.

    loss = 1/|O| Σ_{j∈O} ( λ_m ‖Δx̂_j − Δx_j‖₂ + λ_s ‖Δx̂_j‖₁ ),   λ_m = 2, λ_s = 1

(Diff4Splat, arXiv 2511.00503, losses; O are the valid points.) The second term pulls every point
to standstill, and the paper gives no reason for it: weight 0 switches it off. In a scene in which
nothing moves the truth is zero, and both terms ask for the same.

``huber_delta`` w makes the distance quadratic near 0, √(d² + w²) − w (ours). Most points are
static, and a plain distance pulls each of them to exactly zero as hard as it pulls moving points to
their displacement: an untrained network, which cannot tell them apart, then stays at zero.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.metrics.checks import promote, require_alike, require_mask
from diff4splat.metrics.masked import masked_mean, zero_masked


def track_motion(
    predicted: Float[Tensor, "b *k n 3"],
    truth: Float[Tensor, "b *k n 3"],
    valid: Bool[Tensor, "b *k n"] | None = None,
    *,
    distance_weight: float = 2.0,
    l1_weight: float = 1.0,
    huber_delta: float = 0.0,
) -> Float[Tensor, " b"]:
    """The motion loss over an element's valid points; 0 with zero gradient without any.

    Raises:
        ShapeError: the shapes differ.
    """
    predicted, truth, valid = _known(predicted, truth, valid)
    # The norm's gradient is 0 where both agree exactly.
    apart = torch.linalg.vector_norm(predicted - truth, dim=-1)
    if huber_delta:
        apart = torch.hypot(apart, torch.full_like(apart, huber_delta)) - huber_delta
    loss = distance_weight * apart
    if l1_weight:
        loss = loss + l1_weight * predicted.abs().sum(-1)
    return masked_mean(loss.flatten(1), valid.flatten(1))


def _known(predicted: Tensor, truth: Tensor, valid: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
    require_alike("predicted", predicted, truth)
    predicted, truth = promote(predicted, truth)
    if valid is None:
        valid = torch.ones_like(truth[..., 0], dtype=torch.bool)
    require_mask(valid, truth.shape[:-1])
    keep = valid[..., None]
    return zero_masked(predicted, keep), zero_masked(truth, keep), valid

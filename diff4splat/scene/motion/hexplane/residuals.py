"""Residuals of the decoder added to canonical Gaussians, before their activations.

Axes: ``m`` moving Gaussians, ``k`` harmonics. With Δ from the heads

    mean + Δ      scale · e^Δ      sh + Δ      o e^Δ / (o e^Δ + 1 − o)  =  sigmoid(logit o + Δ)
    quat ⊗ normalise(1 + Δ)   or, as 4DGaussians has it,   normalise(quat + Δ)
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians

LARGEST_LOGARITHM = 40.0
"""Log-scale and logit residuals beyond it count as it: e⁴⁰ is no scale, and e⁸⁹ no float32."""


def apply(
    gaussians: Gaussians,
    residuals: Mapping[str, Tensor],
    rotation: Literal["product", "additive"],
) -> Gaussians:
    """The Gaussians with what each head adds; heads that are not there change nothing.

    Raises:
        ShapeError: the colour head was made for another number of harmonics.
    """
    changed = {}
    if "position" in residuals:
        changed["means"] = gaussians.means + residuals["position"]
    if "rotation" in residuals:
        turn = turned if rotation == "product" else added
        changed["quats"] = turn(gaussians.quats, residuals["rotation"])
    if "scale" in residuals:
        logarithm = residuals["scale"].clamp(-LARGEST_LOGARITHM, LARGEST_LOGARITHM)
        changed["scales"] = gaussians.scales * logarithm.exp()
    if "opacity" in residuals:
        changed["opacities"] = shifted(gaussians.opacities, residuals["opacity"][:, 0])
    if "color" in residuals:
        changed["sh"] = gaussians.sh + _as_harmonics(residuals["color"], gaussians)
    return replace(gaussians, **changed)


def turned(quats: Float[Tensor, "m 4"], residual: Float[Tensor, "m 4"]) -> Float[Tensor, "m 4"]:
    """Canonical on the left, as key frames have it."""
    turn = quaternion.normalize(residual + quaternion.identity_like(residual))
    return quaternion.multiply(quaternion.normalize(quats), turn)


def added(quats: Float[Tensor, "m 4"], residual: Float[Tensor, "m 4"]) -> Float[Tensor, "m 4"]:
    """Quaternions as they are stored, not made unit before: their length says how far Δ turns."""
    none = (quats == 0).all(-1, keepdim=True)
    return quaternion.normalize(
        torch.where(none, quaternion.identity_like(quats), quats) + residual
    )


def shifted(opacities: Float[Tensor, " m"], logit: Float[Tensor, " m"]) -> Float[Tensor, " m"]:
    """sigmoid(logit o + Δ) without the logit, so that 0 and 1 stay finite."""
    half = 0.5 * logit.clamp(-LARGEST_LOGARITHM, LARGEST_LOGARITHM)
    seen = opacities * half.exp()
    return seen / (seen + (1 - opacities) * (-half).exp())


def _as_harmonics(residual: Float[Tensor, "m o"], gaussians: Gaussians) -> Tensor:
    """The lowest harmonics that the head predicts; it may leave the higher ones as they are."""
    channels, want = residual.shape[1], 3 * gaussians.sh.shape[1]
    if channels > want or channels % 3:
        raise ShapeError(
            f"colour head: expected at most {want} outputs for harmonics of degree "
            f"{gaussians.degree}, got {channels}"
        )
    return torch.nn.functional.pad(residual, (0, want - channels)).unflatten(1, (-1, 3))

"""Native 4D Gaussians as their authors store them, and the slice of one at a time.

Axes: ``n`` Gaussians; 4 components are x, y, z, t. With R the rotation of two quaternions,

    Σ = R diag(scales²) Rᵀ = A Aᵀ,  A = R diag(scales)

Given t, space has the mean xyz + velocity · (t − time centre) and a covariance that does not
depend on t (Yang et al., ICLR 2024, arXiv 2310.10642).
"""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry.rotation_4d import rotation_4d


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacetimeCovariance:
    """Place and shape of Gaussians in space-time."""

    means: Float[Tensor, "n 4"]
    """Scene units and, last, seconds."""
    scales: Float[Tensor, "n 4"]
    """Standard deviations along the turned axes, above 0."""
    left_quats: Float[Tensor, "n 4"]
    right_quats: Float[Tensor, "n 4"]

    def __post_init__(self) -> None:
        want = (len(self.means), 4)
        for name in ("means", "scales", "left_quats", "right_quats"):
            got = tuple(getattr(self, name).shape)
            if got != want:
                raise ShapeError(f"SpacetimeCovariance.{name}: expected {want}, got {got}")

    def matrices(self) -> Float[Tensor, "n 4 4"]:
        """Σ of each Gaussian."""
        factor = rotation_4d(self.left_quats, self.right_quats) * self.scales[:, None]
        return factor @ factor.mT

    def to(self, target: torch.device | torch.dtype) -> "SpacetimeCovariance":
        """Move or cast every tensor."""
        return replace(self, **{f.name: getattr(self, f.name).to(target) for f in fields(self)})


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacetimeSlice:
    """What is left of a 4D Gaussian when time is given."""

    means: Float[Tensor, "n 3"]
    """At the time centre."""
    factors: Float[Tensor, "n 3 4"]
    """P with covariance P Pᵀ."""
    velocities: Float[Tensor, "n 3"]
    time_centers_s: Float[Tensor, " n"]
    time_deviations_s: Float[Tensor, " n"]


def conditional(primitives: SpacetimeCovariance) -> SpacetimeSlice:
    """Slices of Gaussians; differentiable, and right in float32 whatever the ratio of scales.

    With n the unit vector along the time row of A, the covariance given time is P Pᵀ with
    P = A_xyz (I − n nᵀ). The projector is made before it meets A: its rounding then stretches P by
    what A holds anyway. The Schur complement Σ_xyz − Σ_xt Σ_tx / Σ_tt subtracts squares instead,
    and is no covariance any more where time scales are 10⁴ times as large as those of space.
    """
    rotation = rotation_4d(primitives.left_quats, primitives.right_quats)
    factor = rotation * primitives.scales[:, None]
    space, time_row = factor[:, :3], factor[:, 3]
    deviations = time_row.norm(dim=-1)
    along = time_row / deviations[:, None]
    identity = torch.eye(4, dtype=along.dtype, device=along.device)
    projector = identity - along[:, :, None] * along[:, None]
    return SpacetimeSlice(
        means=primitives.means[:, :3],
        factors=space @ projector,
        velocities=(space @ along[..., None]).squeeze(-1) / deviations[:, None],
        time_centers_s=primitives.means[:, 3],
        time_deviations_s=deviations,
    )

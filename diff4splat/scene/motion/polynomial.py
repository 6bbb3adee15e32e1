"""Spacetime Gaussians (Li et al., CVPR 2024, arXiv 2312.16812): polynomials and a pulse.

Axes: ``n`` Gaussians, all of which move, ``d`` degrees from 1 on. With the seconds dt since a
Gaussian's time centre

    mean_t = mean + Σ_d motion_d · dt^d
    quat_t = quat + spin · dt
    opacity_t = opacity · exp(−dt² / 2 deviation²)

Scene files have no such motion: ``linearised`` keeps the pulse and the velocity around it.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.times import require_time_s

_SAMPLES = 33
"""Times at which a line is fitted."""
_FAINTEST = 1 / 255


@dataclass(frozen=True, slots=True, kw_only=True)
class PolynomialMotion:
    """Motion of every Gaussian."""

    coefficients: Float[Tensor, "n d 3"]
    """Scene units per second, per second², and so on."""
    spins: Float[Tensor, "n 4"]
    """Change of the quaternion per second."""
    time_centers_s: Float[Tensor, " n"]
    time_deviations_s: Float[Tensor, " n"]
    time_range_s: tuple[float, float]

    @property
    def moving_index(self) -> Int[Tensor, " n"]:
        """All Gaussians."""
        return torch.arange(len(self.spins), device=self.spins.device)

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``."""
        require_time_s(time_s)
        start_s, stop_s = self.time_range_s
        elapsed = min(max(time_s, start_s), stop_s) - self.time_centers_s
        pulse = torch.exp(-0.5 * (elapsed / self.time_deviations_s).square())
        return replace(
            gaussians,
            means=gaussians.means + self.displacement(elapsed),
            quats=quaternion.normalize(gaussians.quats + self.spins * elapsed[:, None]),
            opacities=gaussians.opacities * pulse,
        )

    def displacement(self, elapsed_s: Float[Tensor, " n"]) -> Float[Tensor, "n 3"]:
        """How far each Gaussian is from its mean, so many seconds after its time centre."""
        moved = torch.zeros_like(self.coefficients[:, 0])
        for degree in reversed(range(self.coefficients.shape[1])):
            moved = (moved + self.coefficients[:, degree]) * elapsed_s[:, None]
        return moved

    def select(self, keep: Bool[Tensor, " n"]) -> "PolynomialMotion":
        """The motion of the Gaussians that a mask keeps."""
        return replace(self, **{name: value[keep] for name, value in self._tensors().items()})

    def to(self, target: torch.device | torch.dtype) -> "PolynomialMotion":
        """Move or cast every tensor."""
        return replace(self, **{name: value.to(target) for name, value in self._tensors().items()})

    def _tensors(self) -> dict[str, Tensor]:
        names = ("coefficients", "spins", "time_centers_s", "time_deviations_s")
        return {name: getattr(self, name) for name in names}


def linearised(
    gaussians: Gaussians, motion: PolynomialMotion
) -> tuple[Gaussians, SpacetimeMotion, float]:
    """Lines that follow the curves while each Gaussian shows, and the largest distance left.

    The distance is in scene units, where the opacity is at least 1/255. Rotations are those of
    the time centre.
    """
    start_s, stop_s = motion.time_range_s
    times_s = torch.linspace(start_s, stop_s, _SAMPLES, dtype=torch.float64)
    exact = motion.to(torch.float64)
    elapsed = [t - exact.time_centers_s for t in times_s]
    means = torch.stack([exact.displacement(dt) for dt in elapsed])
    dt = torch.stack(elapsed)
    weights = torch.exp(-((dt / exact.time_deviations_s) ** 2)).clamp_min(1e-12)
    total = weights.sum(0)
    middle_s = (weights * dt).sum(0) / total
    middle = (weights[..., None] * means).sum(0) / total[:, None]
    away = dt - middle_s
    covariance = (weights[..., None] * away[..., None] * (means - middle)).sum(0)
    variance = (weights * away**2).sum(0).clamp_min(1e-12)
    velocity = covariance / variance[:, None]
    line = middle + velocity * away[..., None]
    shows = gaussians.opacities.double() * weights.sqrt() >= _FAINTEST
    error = float(((line - means).norm(dim=-1) * shows).max()) if len(gaussians) else 0.0
    offset = middle - velocity * middle_s[:, None]
    kept = SpacetimeMotion(
        moving_index=motion.moving_index,
        velocities=velocity.to(gaussians.means),
        time_centers_s=motion.time_centers_s,
        time_deviations_s=motion.time_deviations_s,
        time_range_s=motion.time_range_s,
        gate=0.0,
    )
    return replace(gaussians, means=gaussians.means + offset.to(gaussians.means)), kept, error

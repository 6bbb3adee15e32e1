"""Gaussians with constant velocity and a pulse of opacity: native 4D Gaussians.

Axes: ``n`` Gaussians. A 4D covariance is one to one with a slice covariance that does not change, a
mean that moves at constant velocity, and a pulse of opacity in time (Yang et al., ICLR 2024):

    mean(t) = mean + velocity (t - centre)
    opacity(t) = opacity · exp(-((t - centre) / deviation)² / 2), and 0 where the pulse is ≤ gate
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingCloud:
    """What moves the means and gates the opacities of as many Gaussians."""

    velocities: Float[Tensor, "n 3"]
    """Scene units per second."""
    time_centers_s: Float[Tensor, " n"]
    time_deviations_s: Float[Tensor, " n"]
    """Standard deviations of the pulses; infinity shines for ever."""
    gate: float = 0.05
    """Pulses of at most this are dark; 0 has no such rule."""

    def __post_init__(self) -> None:
        count = tuple(self.time_centers_s.shape)
        want = {"velocities": (*count, 3), "time_deviations_s": count}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"MovingCloud.{name}: expected {shape}, got {got}")
        if not 0 <= self.gate < 1:
            raise ConfigError(f"MovingCloud.gate: expected at least 0 and below 1, got {self.gate}")

    def __len__(self) -> int:
        return self.time_centers_s.shape[0]

    def select(self, index: Int[Tensor, " m"]) -> "MovingCloud":
        """Those at indices."""
        return replace(
            self,
            velocities=self.velocities[index],
            time_centers_s=self.time_centers_s[index],
            time_deviations_s=self.time_deviations_s[index],
        )

    @property
    def gate_reach(self) -> float:
        """Deviations from the centre beyond which a pulse is dark; 2.448 for 0.05."""
        return math.sqrt(-2 * math.log(self.gate)) if self.gate > 0 else math.inf


@torch.no_grad()
def valid_motion(
    moving: MovingCloud, valid_mask: Bool[Tensor, " n"]
) -> tuple[Bool[Tensor, " n"], dict[str, int]]:
    """Those of ``valid_mask`` that are finite, can be squared, and have a deviation above 0.

    And how many of them are not, by the first such parameter.
    """
    largest = torch.finfo(moving.velocities.dtype).max ** 0.5
    fine = {
        "velocities": (moving.velocities.abs() < largest).all(1),
        "time_centers_s": moving.time_centers_s.abs() < largest,
        "time_deviations_s": moving.time_deviations_s > 0,
    }
    dropped = {}
    for name, valid in fine.items():
        if count := int((valid_mask & ~valid).sum()):
            dropped[name] = count
        valid_mask = valid_mask & valid
    return valid_mask, dropped

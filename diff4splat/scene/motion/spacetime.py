"""Native 4D Gaussians, sliced in time: constant velocity and a pulse of opacity.

Axes: ``n`` Gaussians, ``m`` moving Gaussians, ``w`` colour waves, ``k`` harmonics. With the time dt
since a Gaussian's time centre, in seconds,

    mean_t = mean + velocity · dt
    opacity_t = opacity · p,  p = exp(−dt² / 2 deviation²), exactly 0 where p ≤ gate
    sh_t = sh + Σ_n cos(2π n dt / period) · color_wave_n,  n = 1 … w

The slice of a 4D Gaussian has the same rotation and scales at all times, so the canonical Gaussians
hold them, and the mean at the time centre (Yang et al., ICLR 2024, arXiv 2310.10642).
"""

import math
from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.times import require_time_s

GATE = 0.05
"""Yang et al. skip a Gaussian whose pulse is at or below this."""
FARTHEST = 38.6
"""Deviations from the centre beyond which the pulse is 0 in float64."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacetimeMotion:
    """Velocity, pulse and colour waves of the Gaussians at ``moving_index``; others are static."""

    moving_index: Int[Tensor, " m"]
    velocities: Float[Tensor, "m 3"]
    """Scene units per second."""
    time_centers_s: Float[Tensor, " m"]
    time_deviations_s: Float[Tensor, " m"]
    """Standard deviation of the pulse, above 0; infinity means always there."""
    time_range_s: tuple[float, float]
    color_waves: Float[Tensor, "m w k 3"] | None = None
    """Spherindrical harmonics of order 1 and 2 in time; order 0 is ``Gaussians.sh``."""
    period_s: float = 1.0
    gate: float = GATE

    def __post_init__(self) -> None:
        self._check_shapes()
        if bool((self.moving_index.diff() <= 0).any()):
            raise ShapeError(
                "SpacetimeMotion.moving_index: expected indices that strictly increase, got "
                "repeats or another order"
            )
        if bool((self.time_deviations_s <= 0).any()):
            raise InputError("SpacetimeMotion.time_deviations_s: expected numbers above 0")
        start, stop = self.time_range_s
        if not (math.isfinite(start) and math.isfinite(stop) and start <= stop):
            raise InputError(
                f"SpacetimeMotion.time_range_s: expected first ≤ last, got {start}, {stop}"
            )
        if not 0 <= self.gate < 1:
            raise ConfigError(f"SpacetimeMotion.gate: expected a number in [0, 1), got {self.gate}")
        if not (math.isfinite(self.period_s) and self.period_s > 0):
            raise ConfigError(
                f"SpacetimeMotion.period_s: expected a finite number above 0, got {self.period_s}"
            )

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``; those that are always the same are passed through."""
        require_time_s(time_s)
        index = self.moving_index
        if len(index) == 0:
            return gaussians
        elapsed = self._elapsed(time_s)
        there = gaussians.opacities[index] * self._pulse(elapsed)
        return replace(
            gaussians,
            means=gaussians.means.index_add(0, index, self.velocities * elapsed[:, None]),
            opacities=gaussians.opacities.index_copy(0, index, there),
            sh=self._wave(gaussians.sh, elapsed),
        )

    def velocity_at(self, gaussians: Gaussians, time_s: float) -> Float[Tensor, "n 3"]:
        """Scene units per second; 0 for what is static and outside ``time_range_s``."""
        start, stop = self.time_range_s
        still = torch.zeros_like(gaussians.means)
        if not start <= time_s <= stop:
            return still
        return still.index_copy(0, self.moving_index, self.velocities)

    def pulse_at(self, time_s: float) -> Float[Tensor, " m"]:
        """The factor p on the opacity of each moving Gaussian, in [0, 1]."""
        return self._pulse(self._elapsed(time_s))

    def select(self, keep: Bool[Tensor, " n"]) -> "SpacetimeMotion":
        """Keep the moving Gaussians where ``keep`` is true, with indices into the smaller set."""
        survives = keep[self.moving_index]
        new_index = keep.long().cumsum(0)[self.moving_index[survives]] - 1
        return replace(self.rows(survives), moving_index=new_index)

    def rows(self, which: Bool[Tensor, " m"]) -> "SpacetimeMotion":
        """Only some of the moving Gaussians; the others of the same set are static."""
        return replace(self, **{name: value[which] for name, value in self._tensors().items()})

    def to(self, target: torch.device | torch.dtype) -> "SpacetimeMotion":
        """Move every tensor; a dtype casts the floating-point ones."""
        cast = isinstance(target, torch.dtype)
        return replace(
            self,
            **{
                name: value if cast and not value.is_floating_point() else value.to(target)
                for name, value in self._tensors().items()
            },
        )

    def _tensors(self) -> dict[str, Tensor]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, Tensor)}

    def _check_shapes(self) -> None:
        lead = tuple(self.moving_index.shape)
        want = {"velocities": (*lead, 3), "time_centers_s": lead, "time_deviations_s": lead}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"SpacetimeMotion.{name}: expected {shape}, got {got}")
        waves = None if self.color_waves is None else tuple(self.color_waves.shape)
        fits = waves is None or (waves[:-3] == lead and waves[1] in (1, 2) and waves[-1] == 3)
        if not fits:
            raise ShapeError(
                "SpacetimeMotion.color_waves: expected "
                f"{(*lead, '1 or 2', 'harmonics', 3)}, got {waves}"
            )

    def _elapsed(self, time_s: float) -> Float[Tensor, " m"]:
        """Seconds since each time centre, of the nearest time that the motion was made for."""
        start, stop = self.time_range_s
        return min(max(time_s, start), stop) - self.time_centers_s

    def _pulse(self, elapsed: Float[Tensor, " m"]) -> Float[Tensor, " m"]:
        reach = math.sqrt(-2 * math.log(self.gate)) if self.gate > 0 else FARTHEST
        inside = elapsed.abs() < reach * self.time_deviations_s
        # Far outside a short pulse dt / deviation overflows, and 0 · ∞ is NaN in its gradient.
        ratio = torch.where(inside, elapsed, 0.0) / self.time_deviations_s
        return torch.where(inside, torch.exp(-0.5 * ratio.square()), 0.0)

    def _wave(
        self, sh: Float[Tensor, "n k 3"], elapsed: Float[Tensor, " m"]
    ) -> Float[Tensor, "n k 3"]:
        if self.color_waves is None:
            return sh
        waves = self.color_waves
        if waves.shape[2] != sh.shape[1]:
            raise ShapeError(
                f"SpacetimeMotion.color_waves: expected {sh.shape[1]} harmonics like the "
                f"Gaussians, got {waves.shape[2]}"
            )
        orders = torch.arange(1, waves.shape[1] + 1, dtype=waves.dtype, device=waves.device)
        phases = elapsed[:, None] * orders * (2 * math.pi / self.period_s)
        change = torch.einsum("mw,mwkc->mkc", phases.cos(), waves)
        return sh.index_add(0, self.moving_index, change)

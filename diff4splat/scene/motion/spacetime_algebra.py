"""Algebra of velocities and pulses: turn, join two, drop those of static Gaussians.

Axes: ``m`` moving Gaussians, ``w`` colour waves, ``k`` harmonics.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacetimeChange:
    """Per moving Gaussian, how far it ever is from its canonical state."""

    offset: Float[Tensor, " m"]
    """Scene units."""
    opacity: Float[Tensor, " m"]
    color: Float[Tensor, " m"]
    """The largest coefficient of a wave."""

    def within(self, offset: float, opacity: float) -> Bool[Tensor, " m"]:
        """Which Gaussians stay within both tolerances and keep their colour; NaN never does."""
        return (self.offset <= offset) & (self.opacity <= opacity) & (self.color == 0)


def largest_change(motion: SpacetimeMotion, gaussians: Gaussians) -> SpacetimeChange:
    """The largest offset and loss of opacity in the time range: both grow away from the centre."""
    ends = [end - motion.time_centers_s for end in motion.time_range_s]
    longest = torch.stack(ends).abs().amax(0)
    remaining = torch.stack([motion.pulse_at(end) for end in motion.time_range_s]).amin(0)
    waves = motion.color_waves
    return SpacetimeChange(
        offset=motion.velocities.norm(dim=-1) * longest,
        opacity=gaussians.opacities[motion.moving_index] * (1 - remaining),
        color=torch.zeros_like(longest) if waves is None else waves.abs().amax((1, 2, 3)),
    )


def keep_moving(
    motion: SpacetimeMotion, moves: Bool[Tensor, " m"]
) -> SpacetimeMotion | StaticMotion:
    """The motion of the Gaussians that ``moves``; static when none does."""
    if not bool(moves.any()):
        return StaticMotion(time_range_s=motion.time_range_s)
    return motion.rows(moves)


def turn(motion: SpacetimeMotion, rotation: Float[Tensor, "3 3"], scale: float) -> SpacetimeMotion:
    """The motion in a world that is turned and scaled; times stay as they are."""
    velocities = motion.velocities @ rotation.to(motion.velocities).mT * scale
    waves = motion.color_waves
    if waves is not None:
        lobes = harmonics.rotate(waves.flatten(0, 1), rotation)
        waves = lobes.unflatten(0, waves.shape[:2])
    return replace(motion, velocities=velocities, color_waves=waves)


def join(first: Motion, second: Motion, count: int, degree: int) -> SpacetimeMotion:
    """One motion of the ``count`` Gaussians of ``first`` followed by those of ``second``.

    Waves are padded with zeros to the harmonics of ``degree``.

    Raises:
        ConfigError: neither static nor of this kind, or of different ranges, gates or periods,
            which have no common form.
    """
    if isinstance(second, SpacetimeMotion):
        second = replace(second, moving_index=second.moving_index + count)
    for motion in (first, second):
        if not isinstance(motion, SpacetimeMotion | StaticMotion):
            raise ConfigError(
                "merge: expected static or native 4D motion beside native 4D motion, got "
                f"{type(motion).__name__}; sample both at key times first"
            )
    parts = [part for part in (first, second) if isinstance(part, SpacetimeMotion)]
    if len(parts) == 2:
        _require_common(*parts)
    orders, bands = max(map(_orders, parts)), harmonics.BAND_SIZES[degree]
    waves = torch.cat([_padded_waves(part, orders, bands) for part in parts]) if orders else None
    names = ("moving_index", "velocities", "time_centers_s", "time_deviations_s")
    joined = {name: torch.cat([getattr(part, name) for part in parts]) for name in names}
    return replace(max(parts, key=_orders), **joined, color_waves=waves)


def _require_common(first: SpacetimeMotion, second: SpacetimeMotion) -> None:
    # Without waves on both sides no two periods meet.
    period = ("period_s",) if _orders(first) and _orders(second) else ()
    for name in ("time_range_s", "gate", *period):
        values = getattr(first, name), getattr(second, name)
        if values[0] != values[1]:
            raise ConfigError(
                f"merge: expected the same {name} in both motions, got {values[0]} and "
                f"{values[1]}; make them equal first"
            )


def _orders(motion: SpacetimeMotion) -> int:
    return 0 if motion.color_waves is None else motion.color_waves.shape[1]


def _padded_waves(motion: SpacetimeMotion, orders: int, bands: int) -> Float[Tensor, "m w k 3"]:
    """Waves with as many orders and harmonics as the other part has; the new ones are 0."""
    waves = motion.color_waves
    if waves is None:
        return motion.velocities.new_zeros(len(motion.moving_index), orders, bands, 3)
    missing = (0, 0, 0, bands - waves.shape[2], 0, orders - waves.shape[1])
    return torch.nn.functional.pad(waves, missing)

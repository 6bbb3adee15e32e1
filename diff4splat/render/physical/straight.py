"""Any motion in a short stretch of time: Gaussians that go straight and keep their shape.

Axes: ``n`` Gaussians. From the states at both ends of the stretch,

    mean(t) = (mean₀ + mean₁) / 2 + velocity (t − middle),    velocity = (mean₁ − mean₀) / length

and rotation, logarithm of the scales, opacity and colour are those halfway. The error in place is
of second order in the length, that in shape of first order. Native 4D Gaussians without colour
waves are exact at any length.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """What rays of an interval of time look at; times are relative to the frame's."""

    gaussians: Gaussians
    moving: MovingCloud | None
    earliest_s: float
    latest_s: float


def is_straight(scene: Scene) -> bool:
    """Whether one stretch is exact, however long."""
    return isinstance(scene.motion, SpacetimeMotion) and scene.motion.color_waves is None


def exact_stretch(scene: Scene, earliest_s: float, latest_s: float, base_s: float) -> Stretch:
    """Native 4D Gaussians as they are, with times relative to ``base_s``.

    Colours that wave are those halfway between both ends.
    """
    gaussians, motion = scene.gaussians, scene.motion
    assert isinstance(motion, SpacetimeMotion)
    if motion.color_waves is not None:
        early, late = (scene.state_at(base_s + at).sh for at in (earliest_s, latest_s))
        gaussians = replace(gaussians, sh=torch.lerp(early, late, 0.5))
    index, still = motion.moving_index, torch.zeros_like(gaussians.means)
    centers_s = (motion.time_centers_s.double() - base_s).to(still)
    moving = MovingCloud(
        velocities=still.index_copy(0, index, motion.velocities),
        time_centers_s=still[:, 0].index_copy(0, index, centers_s),
        time_deviations_s=torch.full_like(still[:, 0], torch.inf).index_copy(
            0, index, motion.time_deviations_s
        ),
        gate=motion.gate,
    )
    return Stretch(gaussians=gaussians, moving=moving, earliest_s=earliest_s, latest_s=latest_s)


def still(gaussians: Gaussians, earliest_s: float, latest_s: float) -> Stretch:
    """Gaussians that do not move meanwhile."""
    return Stretch(gaussians=gaussians, moving=None, earliest_s=earliest_s, latest_s=latest_s)


def between(early: Gaussians, late: Gaussians, earliest_s: float, latest_s: float) -> Stretch:
    """The stretch from one state to another."""
    length = latest_s - earliest_s
    if length <= 0:
        return still(early, earliest_s, latest_s)
    velocities = (late.means - early.means) / length
    middle_s = torch.full_like(early.opacities, 0.5 * (earliest_s + latest_s))
    moving = MovingCloud(
        velocities=velocities,
        time_centers_s=middle_s,
        time_deviations_s=torch.full_like(early.opacities, torch.inf),
    )
    return Stretch(
        gaussians=halfway(early, late), moving=moving, earliest_s=earliest_s, latest_s=latest_s
    )


def halfway(early: Gaussians, late: Gaussians) -> Gaussians:
    """In the middle of two states of the same Gaussians."""
    one, other = quaternion.normalize(early.quats), quaternion.normalize(late.quats)
    same_side = (one * other).sum(-1, keepdim=True) >= 0
    # √(a b) of scales that may be 0 has no gradient there; what is equal stays as it is, and both
    # get half of its gradient.
    tiny = torch.finfo(early.scales.dtype).tiny
    scales = early.scales.clamp_min(tiny).sqrt() * late.scales.clamp_min(tiny).sqrt()
    equal = early.scales == late.scales
    scales = torch.where(equal, 0.5 * (early.scales + late.scales), scales)
    return replace(
        early,
        means=torch.lerp(early.means, late.means, 0.5),
        quats=one + torch.where(same_side, other, -other),
        scales=scales,
        opacities=torch.lerp(early.opacities, late.opacities, 0.5),
        sh=torch.lerp(early.sh, late.sh, 0.5),
    )


def smoothed(stretch: Stretch, place: Float[Tensor, "3"], variance: float) -> Stretch:
    """Widened by ``variance`` (radians²) at the distance from ``place``; 0 changes nothing.

    What moves is as far away as in the middle of the stretch.
    """
    if variance == 0:
        return stretch
    gaussians, moving, means = stretch.gaussians, stretch.moving, stretch.gaussians.means
    if moving is not None:
        middle_s = 0.5 * (stretch.earliest_s + stretch.latest_s)
        means = means + moving.velocities * (middle_s - moving.time_centers_s)[:, None]
    squared = (means - place).square().sum(-1, keepdim=True)
    variances = gaussians.scales.square() + variance * squared
    # A point at the camera itself stays one, with a finite gradient.
    tiny = torch.finfo(variances.dtype).tiny
    widened = replace(gaussians, scales=variances.clamp_min(tiny).sqrt())
    return replace(stretch, gaussians=widened)

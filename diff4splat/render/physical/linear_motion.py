"""Linear approximation of any motion in a short time: constant velocity, constant shape.

Axes: ``n`` Gaussians. From the states at both ends of the segment,

    mean(t) = (mean₀ + mean₁) / 2 + velocity (t − middle),    velocity = (mean₁ − mean₀) / length

and rotation, logarithm of the scales, opacity and colour are those at the midpoint. The error in
position is of second order in the length, that in shape of first order. Native 4D Gaussians without
colour waves are exact at any length.
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
class LinearSegment:
    """Gaussians in an interval of time; times are relative to the frame's."""

    gaussians: Gaussians
    moving: MovingCloud | None
    earliest_s: float
    latest_s: float


def is_linear(scene: Scene) -> bool:
    """Whether one segment is exact, however long."""
    return isinstance(scene.motion, SpacetimeMotion) and scene.motion.color_waves is None


def native_segment(
    scene: Scene, earliest_s: float, latest_s: float, base_s: float
) -> LinearSegment:
    """Native 4D Gaussians unchanged, with times relative to ``base_s``.

    Colours that oscillate in time are those at the midpoint.
    """
    gaussians, motion = scene.gaussians, scene.motion
    assert isinstance(motion, SpacetimeMotion)
    if motion.color_waves is not None:
        early, late = (scene.state_at(base_s + at).sh for at in (earliest_s, latest_s))
        gaussians = replace(gaussians, sh=torch.lerp(early, late, 0.5))
    index, zeros = motion.moving_index, torch.zeros_like(gaussians.means)
    centers_s = (motion.time_centers_s.double() - base_s).to(zeros)
    moving = MovingCloud(
        velocities=zeros.index_copy(0, index, motion.velocities),
        time_centers_s=zeros[:, 0].index_copy(0, index, centers_s),
        time_deviations_s=torch.full_like(zeros[:, 0], torch.inf).index_copy(
            0, index, motion.time_deviations_s
        ),
        gate=motion.gate,
    )
    return LinearSegment(
        gaussians=gaussians, moving=moving, earliest_s=earliest_s, latest_s=latest_s
    )


def static_segment(gaussians: Gaussians, earliest_s: float, latest_s: float) -> LinearSegment:
    """Gaussians that do not move in the interval."""
    return LinearSegment(gaussians=gaussians, moving=None, earliest_s=earliest_s, latest_s=latest_s)


def linear_segment(
    early: Gaussians, late: Gaussians, earliest_s: float, latest_s: float
) -> LinearSegment:
    """The segment from one state to another."""
    length = latest_s - earliest_s
    if length <= 0:
        return static_segment(early, earliest_s, latest_s)
    velocities = (late.means - early.means) / length
    middle_s = torch.full_like(early.opacities, 0.5 * (earliest_s + latest_s))
    moving = MovingCloud(
        velocities=velocities,
        time_centers_s=middle_s,
        time_deviations_s=torch.full_like(early.opacities, torch.inf),
    )
    return LinearSegment(
        gaussians=midpoint(early, late), moving=moving, earliest_s=earliest_s, latest_s=latest_s
    )


def midpoint(early: Gaussians, late: Gaussians) -> Gaussians:
    """The midpoint of two states of the same Gaussians."""
    one, other = quaternion.normalize(early.quats), quaternion.normalize(late.quats)
    same_side = (one * other).sum(-1, keepdim=True) >= 0
    # √(a b) has no gradient where a scale is 0. Equal scales stay equal, and each gets half of the
    # gradient.
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


def smoothed_segment(
    segment: LinearSegment, position: Float[Tensor, "3"], variance: float
) -> LinearSegment:
    """Widened by ``variance`` (radians²) times the squared distance from ``position``.

    The distance of moving Gaussians is that in the middle of the segment.
    """
    if variance == 0:
        return segment
    gaussians, moving, means = segment.gaussians, segment.moving, segment.gaussians.means
    if moving is not None:
        middle_s = 0.5 * (segment.earliest_s + segment.latest_s)
        means = means + moving.velocities * (middle_s - moving.time_centers_s)[:, None]
    squared = (means - position).square().sum(-1, keepdim=True)
    variances = gaussians.scales.square() + variance * squared
    # A point at the camera stays a point, with a finite gradient.
    tiny = torch.finfo(variances.dtype).tiny
    widened = replace(gaussians, scales=variances.clamp_min(tiny).sqrt())
    return replace(segment, gaussians=widened)

"""Algebra of key-framed motions: resample, join two, drop the keys of static Gaussians.

Axes: ``t`` key times, ``m`` moving Gaussians. A linear motion is linear (slerp is constant speed)
between its keys, so inserting key times changes nothing; a cubic one has no such property.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestChange:
    """Per moving Gaussian, how far any key is from the canonical state."""

    offset: Float[Tensor, " m"]
    """Scene units."""
    angle_rad: Float[Tensor, " m"]
    log_scale: Float[Tensor, " m"]

    def within(self, offset: float, angle_rad: float, log_scale: float) -> Bool[Tensor, " m"]:
        """Which Gaussians stay within all tolerances; NaN is never within."""
        turned_little = self.angle_rad <= angle_rad
        return (self.offset <= offset) & turned_little & (self.log_scale <= log_scale)


def largest_change(motion: KeyframeMotion) -> LargestChange:
    """The largest offset, rotation angle and log-scale offset over all keys."""
    turned = quaternion.normalize(motion.rotations)
    # atan2 and not acos: acos cannot tell angles below 1e-3 rad apart in float32.
    angle_rad = 2 * torch.atan2(turned[..., 1:].norm(dim=-1), turned[..., 0].abs())
    return LargestChange(
        offset=motion.offsets.norm(dim=-1).amax(0),
        angle_rad=angle_rad.amax(0),
        log_scale=motion.log_scale_offsets.abs().amax((0, 2)),
    )


def keep_moving(motion: KeyframeMotion, moves: Bool[Tensor, " m"]) -> KeyframeMotion | StaticMotion:
    """The keys of the Gaussians that ``moves``; static motion when none does."""
    if not bool(moves.any()):
        return StaticMotion(time_range_s=motion.time_range_s)
    return replace(
        motion,
        moving_index=motion.moving_index[moves],
        offsets=motion.offsets[:, moves],
        rotations=motion.rotations[:, moves],
        log_scale_offsets=motion.log_scale_offsets[:, moves],
    )


def resample(motion: KeyframeMotion, key_times_s: Float[Tensor, " t"]) -> KeyframeMotion:
    """Linear key frames at other times; exact where these contain all keys of a linear motion."""
    count = len(motion.moving_index)
    identity = torch.arange(count, device=motion.moving_index.device)
    fine = replace(motion.to(torch.float64), moving_index=identity)
    # A Gaussian at the origin, unturned and of size one, reads out the deformation itself.
    probe = Gaussians(
        means=fine.offsets.new_zeros(count, 3),
        quats=quaternion.identity_like(fine.rotations.new_zeros(count, 4)),
        scales=fine.offsets.new_ones(count, 3),
        opacities=fine.offsets.new_ones(count),
        sh=fine.offsets.new_zeros(count, 1, 3),
    )
    states = [fine.state_at(probe, float(time_s)) for time_s in key_times_s.double()]
    return replace(
        motion,
        key_times_s=key_times_s.to(motion.key_times_s),
        offsets=torch.stack([state.means for state in states]).to(motion.offsets),
        rotations=torch.stack([state.quats for state in states]).to(motion.rotations),
        log_scale_offsets=torch.stack([state.scales.log() for state in states]).to(motion.offsets),
        interpolation="linear",
    )


def hold_until(motion: KeyframeMotion | StaticMotion, end_s: float) -> Motion:
    """The motion, standing still from its last key until ``end_s``."""
    start_s, last_s = motion.time_range_s
    if last_s >= end_s:
        return motion
    if isinstance(motion, StaticMotion):
        return replace(motion, time_range_s=(start_s, end_s))
    times_s = torch.cat([motion.key_times_s, motion.key_times_s.new_tensor([end_s])])
    return resample(motion, times_s)


def join(first: Motion, second: Motion, count: int) -> KeyframeMotion | StaticMotion:
    """One motion of the ``count`` Gaussians that ``first`` moves followed by those of ``second``.

    Raises:
        ConfigError: a motion that is neither static nor key-framed, or cubic key frames at
            different times, which have no exact common form.
    """
    for motion in (first, second):
        require_editable(motion, "merge")
    if isinstance(second, KeyframeMotion):
        second = replace(second, moving_index=second.moving_index + count)
    keyed = [motion for motion in (first, second) if isinstance(motion, KeyframeMotion)]
    if len(keyed) == 2:
        return _concatenate(*_on_common_keys(*keyed))
    if keyed:
        return keyed[0]
    ranges = (first.time_range_s, second.time_range_s)
    span = (min(start for start, _ in ranges), max(stop for _, stop in ranges))
    return StaticMotion(time_range_s=span)


def require_editable(motion: Motion, what: str) -> None:
    """Refuse a motion whose parts ``what`` does not know.

    Raises:
        ConfigError: ``motion`` is neither static nor key-framed.
    """
    if not isinstance(motion, KeyframeMotion | StaticMotion):
        raise ConfigError(
            f"{what}: expected static or key-framed motion, got {type(motion).__name__}; "
            "sample it at key times first"
        )


def _on_common_keys(
    first: KeyframeMotion, second: KeyframeMotion
) -> tuple[KeyframeMotion, KeyframeMotion]:
    same_times = torch.equal(first.key_times_s, second.key_times_s)
    if same_times and first.interpolation == second.interpolation:
        return first, second
    if {first.interpolation, second.interpolation} != {"linear"}:
        raise ConfigError(
            "merge: expected linear key frames where key times or interpolations differ, "
            "got cubic; resample the cubic motion to linear keys first"
        )
    times = torch.cat([first.key_times_s, second.key_times_s]).unique()
    return resample(first, times), resample(second, times)


def _concatenate(first: KeyframeMotion, second: KeyframeMotion) -> KeyframeMotion:
    return replace(
        first,
        moving_index=torch.cat([first.moving_index, second.moving_index]),
        offsets=torch.cat([first.offsets, second.offsets], 1),
        rotations=torch.cat([first.rotations, second.rotations], 1),
        log_scale_offsets=torch.cat([first.log_scale_offsets, second.log_scale_offsets], 1),
    )

"""Velocities and pulses as tensors. Axes: ``m`` moving Gaussians, ``w`` waves, ``k`` harmonics."""

import math
from collections.abc import Mapping
from typing import Any

from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.motions.stored import (
    MotionCodec,
    StoredMotion,
    require_one_dtype,
    take_time_range,
)
from diff4splat.io.scene_files.tensor_checks import take_floats, take_index
from diff4splat.scene.motion.spacetime import SpacetimeMotion


def _pack(motion: SpacetimeMotion) -> StoredMotion:
    tensors = {
        "moving_index": motion.moving_index.long(),
        "velocities": motion.velocities,
        "time_centers_s": motion.time_centers_s,
        "time_deviations_s": motion.time_deviations_s,
    }
    if motion.color_waves is not None:
        tensors["color_waves"] = motion.color_waves
    settings = {"period_s": motion.period_s, "gate": motion.gate}
    return StoredMotion(settings=settings, tensors=tensors)


def _unpack(stored: StoredMotion, count: int) -> SpacetimeMotion:
    tensors = stored.tensors
    index = take_index(tensors, "moving_index", count)
    parts = {
        "velocities": take_floats(tensors, "velocities", (len(index), 3)),
        "time_centers_s": take_floats(tensors, "time_centers_s", (len(index),)),
        "time_deviations_s": _take_deviations(tensors, len(index)),
        "color_waves": _take_waves(tensors, len(index)),
    }
    require_one_dtype({**parts, "means": tensors.get("means")})
    return SpacetimeMotion(
        moving_index=index,
        time_range_s=take_time_range(stored.settings),
        period_s=_take_period(stored.settings),
        gate=_take_gate(stored.settings),
        **parts,
    )


def _take_deviations(tensors: Mapping[str, Tensor], count: int) -> Tensor:
    """Standard deviations above 0; infinity is allowed here and nowhere else."""
    name = "time_deviations_s"
    given = tensors.get(name)
    # Checked with 1 in the place of infinity, which means that a Gaussian is always there.
    bounded = {} if given is None else {name: given.masked_fill(given == math.inf, 1)}
    if bool((take_floats(bounded, name, (count,)) <= 0).any()):
        raise FileFormatError(f"{name}: expected seconds above 0, got 0 or less")
    return given


def _take_waves(tensors: Mapping[str, Tensor], count: int) -> Tensor | None:
    if "color_waves" not in tensors:
        return None
    harmonics = tensors["sh"].shape[1] if "sh" in tensors else None
    waves = take_floats(tensors, "color_waves", (count, None, harmonics, 3))
    if waves.shape[1] not in (1, 2):
        raise FileFormatError(f"color_waves: expected 1 or 2 waves, got {waves.shape[1]}")
    return waves


def _take_period(settings: Mapping[str, Any]) -> float:
    period_s = _take_number(settings, "period_s")
    if period_s <= 0:
        raise FileFormatError(f"metadata 'period_s': expected a number above 0, got {period_s}")
    return period_s


def _take_gate(settings: Mapping[str, Any]) -> float:
    gate = _take_number(settings, "gate")
    if not 0 <= gate < 1:
        raise FileFormatError(f"metadata 'gate': expected a number in [0, 1), got {gate}")
    return gate


def _take_number(settings: Mapping[str, Any], key: str) -> float:
    value = settings.get(key, ...)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    # A comparison, not isfinite: JSON allows whole numbers that no float can hold.
    if not (number and abs(value) < 1e300):
        got = "nothing" if value is ... else repr(value)[:60]
        raise FileFormatError(f"metadata '{key}': expected a finite number, got {got}")
    return float(value)


CODEC = MotionCodec(motion_type=SpacetimeMotion, pack=_pack, unpack=_unpack)

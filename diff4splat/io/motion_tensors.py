"""Motions as named tensors and JSON settings, one codec per kind.

A further kind of motion is one entry of ``CODECS``; the scene file itself does not change.
Axes: ``t`` key times, ``m`` moving Gaussians.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.tensor_checks import take_floats, take_index, take_numbers, take_value
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredMotion:
    """A motion in the terms of a file."""

    settings: Mapping[str, Any]
    """JSON values; ``kind`` names the codec and ``time_range_s`` is always there."""
    tensors: Mapping[str, Tensor] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCodec:
    """How one kind of motion is written and read."""

    motion_type: type
    pack: Callable[[Any], StoredMotion]
    """Takes a motion of that type."""
    unpack: Callable[[StoredMotion, int], Motion]
    """Takes the number of Gaussians; raises FileFormatError or ShapeError."""


def pack_motion(motion: Motion) -> StoredMotion:
    """Tensors and settings of any known motion; one that moves nothing is stored as static.

    Raises:
        InputError: no codec knows this kind of motion.
    """
    if len(motion.moving_index) == 0:
        motion = StaticMotion(time_range_s=motion.time_range_s)
    common = {"time_range_s": list(motion.time_range_s)}
    for kind, codec in CODECS.items():
        if isinstance(motion, codec.motion_type):
            stored = codec.pack(motion)
            return replace(stored, settings={"kind": kind, **common, **stored.settings})
    raise InputError(
        f"motion: expected one of {', '.join(sorted(CODECS))}, got {type(motion).__name__}"
    )


def unpack_motion(stored: StoredMotion, count: int) -> Motion:
    """The motion of ``count`` Gaussians.

    Raises:
        FileFormatError: the kind is unknown, or a tensor or setting is missing or wrong.
    """
    kind = take_value(stored.settings, "kind", str)
    if kind not in CODECS:
        known = ", ".join(sorted(CODECS))
        raise FileFormatError(
            f"motion: expected one of {known}, got {kind[:40]!r}; update diff4splat"
        )
    return CODECS[kind].unpack(stored, count)


def _pack_static(motion: StaticMotion) -> StoredMotion:
    del motion
    return StoredMotion(settings={})


def _unpack_static(stored: StoredMotion, count: int) -> StaticMotion:
    del count
    first, last = take_numbers(stored.settings, "time_range_s", 2)
    if first > last:
        raise FileFormatError(
            f"metadata 'time_range_s': expected first ≤ last, got {first}, {last}"
        )
    return StaticMotion(time_range_s=(float(first), float(last)))


def _pack_keyframes(motion: KeyframeMotion) -> StoredMotion:
    tensors = {
        "key_times_s": motion.key_times_s,
        "moving_index": motion.moving_index.long(),
        "offsets": motion.offsets,
        "rotations": motion.rotations,
        "log_scale_offsets": motion.log_scale_offsets,
    }
    return StoredMotion(settings={"interpolation": motion.interpolation}, tensors=tensors)


def _unpack_keyframes(stored: StoredMotion, count: int) -> KeyframeMotion:
    interpolation = take_value(stored.settings, "interpolation", str)
    if interpolation not in ("linear", "cubic"):
        raise FileFormatError(
            f"metadata 'interpolation': expected linear or cubic, got {interpolation[:40]!r}"
        )
    times = take_floats(stored.tensors, "key_times_s", (None,))
    index = take_index(stored.tensors, "moving_index", count)
    lead = (len(times), len(index))
    return KeyframeMotion(
        key_times_s=times,
        moving_index=index,
        offsets=take_floats(stored.tensors, "offsets", (*lead, 3)),
        rotations=take_floats(stored.tensors, "rotations", (*lead, 4)),
        log_scale_offsets=take_floats(stored.tensors, "log_scale_offsets", (*lead, 3)),
        interpolation=interpolation,
    )


CODECS: dict[str, MotionCodec] = {
    "static": MotionCodec(motion_type=StaticMotion, pack=_pack_static, unpack=_unpack_static),
    "keyframes": MotionCodec(
        motion_type=KeyframeMotion, pack=_pack_keyframes, unpack=_unpack_keyframes
    ),
}

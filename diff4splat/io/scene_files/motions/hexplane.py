"""Fields on six planes as tensors, under ``hexplane.`` and the names of ``HexPlaneMotion.tensors``.

Axes: ``m`` moving Gaussians, ``l`` levels, ``k`` harmonics. Planes are ``rj ri c``.
"""

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
from diff4splat.io.scene_files.tensor_checks import take_floats, take_index, take_value
from diff4splat.scene.motion.hexplane.decoder import HEAD_NAMES, Layer, MotionDecoder
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.hexplane.planes import PLANE_NAMES, HexPlanes

_PREFIX = "hexplane."
_MOST_PARTS = 64
"""Levels, or layers of the trunk: a larger number is a damaged file."""


def _pack(motion: HexPlaneMotion) -> StoredMotion:
    named = {**motion.tensors(), "bounds": motion.planes.bounds}
    tensors = {f"{_PREFIX}{name}": tensor for name, tensor in named.items()}
    settings = {
        "levels": len(motion.planes.levels),
        "trunk_layers": len(motion.decoder.trunk),
        "heads": list(motion.decoder.heads),
        "rotation": motion.rotation,
        "time_mapping": motion.planes.time_mapping,
    }
    return StoredMotion(
        settings=settings, tensors={"moving_index": motion.moving_index.long(), **tensors}
    )


def _unpack(stored: StoredMotion, count: int) -> HexPlaneMotion:
    tensors, settings = stored.tensors, stored.settings
    planes = HexPlanes(
        levels=tuple(_take_level(tensors, k) for k in range(_take_count(settings, "levels"))),
        bounds=take_floats(tensors, f"{_PREFIX}bounds", (2, 3)),
        time_range_s=take_time_range(settings),
        time_mapping=_take_choice(settings, "time_mapping", ("full", "half")),
    )
    motion = HexPlaneMotion(
        planes=planes,
        decoder=_take_decoder(tensors, settings),
        moving_index=take_index(tensors, "moving_index", count),
        rotation=_take_choice(settings, "rotation", ("product", "additive")),
    )
    require_one_dtype({**motion.tensors(), "bounds": planes.bounds, "means": tensors.get("means")})
    _require_harmonics(motion, tensors.get("sh"))
    return motion


def _take_level(tensors: Mapping[str, Tensor], level: int) -> tuple[Tensor, ...]:
    names = [f"{_PREFIX}planes.{level}.{name}" for name in PLANE_NAMES]
    return tuple(take_floats(tensors, name, (None, None, None)) for name in names)


def _take_decoder(tensors: Mapping[str, Tensor], settings: Mapping[str, Any]) -> MotionDecoder:
    heads = take_value(settings, "heads", list)
    if [name for name in HEAD_NAMES if name in heads] != heads:
        raise FileFormatError(
            f"metadata 'heads': expected some of {', '.join(HEAD_NAMES)} in this order, got "
            f"{repr(heads)[:60]}"
        )
    depth = _take_count(settings, "trunk_layers")
    return MotionDecoder(
        trunk=tuple(_take_layer(tensors, f"trunk.{k}") for k in range(depth)),
        heads={
            name: (_take_layer(tensors, f"{name}.0"), _take_layer(tensors, f"{name}.1"))
            for name in heads
        },
    )


def _take_layer(tensors: Mapping[str, Tensor], name: str) -> Layer:
    weight = take_floats(tensors, f"{_PREFIX}{name}.weight", (None, None))
    bias = take_floats(tensors, f"{_PREFIX}{name}.bias", (len(weight),))
    return Layer(weight=weight, bias=bias)


def _take_count(settings: Mapping[str, Any], key: str) -> int:
    count = take_value(settings, key, int | None)
    if count is None or not 1 <= count <= _MOST_PARTS:
        raise FileFormatError(f"metadata '{key}': expected 1 to {_MOST_PARTS}, got {count}")
    return count


def _take_choice(settings: Mapping[str, Any], key: str, choices: tuple[str, ...]) -> Any:
    choice = take_value(settings, key, str)
    if choice not in choices:
        raise FileFormatError(
            f"metadata '{key}': expected {' or '.join(choices)}, got {choice[:40]!r}"
        )
    return choice


def _require_harmonics(motion: HexPlaneMotion, sh: Tensor | None) -> None:
    head = motion.decoder.heads.get("color")
    if head is None or sh is None or sh.ndim != 3:
        return
    channels = len(head[1].bias)
    if channels > 3 * sh.shape[1] or channels % 3:
        raise FileFormatError(
            f"{_PREFIX}color.1.bias: expected at most {3 * sh.shape[1]} outputs for sh, three per "
            f"harmonic, got {channels}"
        )


CODEC = MotionCodec(motion_type=HexPlaneMotion, pack=_pack, unpack=_unpack)

"""Motions as named tensors and JSON settings, one codec per kind.

A further kind of motion is a file in ``io/motions`` and an entry of ``CODECS``; the scene file
itself does not change.
"""

from dataclasses import replace

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.scene_files.motions import hexplane, keyframes, spacetime, static
from diff4splat.io.scene_files.motions.stored import MotionCodec, StoredMotion
from diff4splat.io.scene_files.tensor_checks import take_value
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

CODECS: dict[str, MotionCodec] = {
    "static": static.CODEC,
    "keyframes": keyframes.CODEC,
    "spacetime": spacetime.CODEC,
    "hexplane": hexplane.CODEC,
}


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

"""Key frames as tensors. Axes: ``t`` key times, ``m`` moving Gaussians."""

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.motions.stored import MotionCodec, StoredMotion, require_one_dtype
from diff4splat.io.scene_files.tensor_checks import take_floats, take_index, take_value
from diff4splat.scene.motion.keyframes import KeyframeMotion


def _pack(motion: KeyframeMotion) -> StoredMotion:
    tensors = {
        "key_times_s": motion.key_times_s,
        "moving_index": motion.moving_index.long(),
        "offsets": motion.offsets,
        "rotations": motion.rotations,
        "log_scale_offsets": motion.log_scale_offsets,
    }
    return StoredMotion(settings={"interpolation": motion.interpolation}, tensors=tensors)


def _unpack(stored: StoredMotion, count: int) -> KeyframeMotion:
    interpolation = take_value(stored.settings, "interpolation", str)
    if interpolation not in ("linear", "cubic"):
        raise FileFormatError(
            f"metadata 'interpolation': expected linear or cubic, got {interpolation[:40]!r}"
        )
    times = take_floats(stored.tensors, "key_times_s", (None,))
    index = take_index(stored.tensors, "moving_index", count)
    lead = (len(times), len(index))
    values = {
        "offsets": take_floats(stored.tensors, "offsets", (*lead, 3)),
        "rotations": take_floats(stored.tensors, "rotations", (*lead, 4)),
        "log_scale_offsets": take_floats(stored.tensors, "log_scale_offsets", (*lead, 3)),
    }
    require_one_dtype({**values, "means": stored.tensors.get("means")})
    return KeyframeMotion(
        key_times_s=times, moving_index=index, interpolation=interpolation, **values
    )


CODEC = MotionCodec(motion_type=KeyframeMotion, pack=_pack, unpack=_unpack)

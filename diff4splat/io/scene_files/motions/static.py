"""Nothing moves: nothing is stored but the time range."""

from diff4splat.io.scene_files.motions.stored import MotionCodec, StoredMotion, take_time_range
from diff4splat.scene.motion.static import StaticMotion


def _pack(motion: StaticMotion) -> StoredMotion:
    del motion
    return StoredMotion(settings={})


def _unpack(stored: StoredMotion, count: int) -> StaticMotion:
    del count
    return StaticMotion(time_range_s=take_time_range(stored.settings))


CODEC = MotionCodec(motion_type=StaticMotion, pack=_pack, unpack=_unpack)

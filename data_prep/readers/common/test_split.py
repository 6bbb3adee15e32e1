"""Default and requested test splits, by camera or by time."""

from dataclasses import replace

from diff4splat.data_prep.readers.common.undecoded_capture import Shot
from diff4splat.errors import ConfigError

TEST_TIME_STEP = 8
"""Every n-th time is a test time for one or two cameras (LLFF and most later work)."""
MIN_CAMERAS = 3
"""Smallest number of cameras to hold one out: training needs two for depth."""


def choose_test_split(
    shots: list[Shot], cameras: tuple[int, ...] | None, name: str
) -> tuple[list[Shot], str]:
    """Hold out the given cameras, or use the default rule; also returns the reason as text.

    Raises:
        ConfigError: there is no such camera, or nothing would be left to learn from.
    """
    if cameras is None:
        return _default(shots)
    require_cameras(cameras, 1 + max((shot.camera for shot in shots), default=0), name)
    return hold_out_cameras(shots, cameras), requested_reason(cameras)


def hold_out_cameras(shots: list[Shot], cameras: tuple[int, ...]) -> list[Shot]:
    """Hold out exactly the frames of these cameras."""
    return [replace(shot, held_out=shot.camera in cameras) for shot in shots]


def hold_out_times(shots: list[Shot]) -> list[Shot]:
    """Hold out every eighth time, starting with the first."""
    times_s = sorted({shot.time_s for shot in shots})
    held = set(times_s[::TEST_TIME_STEP]) if len(times_s) > 1 else set()
    return [replace(shot, held_out=shot.time_s in held) for shot in shots]


def require_cameras(cameras: tuple[int, ...], count: int, name: str) -> None:
    """Require existing cameras, and at least one for training.

    Raises:
        ConfigError: one of these.
    """
    if any(not 0 <= camera < count for camera in cameras):
        raise ConfigError(
            f"{name}: hold_out: expected cameras from 0 to {count - 1}, got {list(cameras)}; they "
            "count in the order of their names"
        )
    if len(set(cameras)) == count:
        raise ConfigError(
            f"{name}: hold_out: expected cameras to be left to learn from, got all {count} of "
            "them; hold out fewer"
        )


def requested_reason(cameras: tuple[int, ...]) -> str:
    """The reason for a requested split."""
    named = ", ".join(str(camera) for camera in cameras)
    return f"cameras {named} held out, as asked for" if cameras else "nothing, as asked for"


def _default(shots: list[Shot]) -> tuple[list[Shot], str]:
    cameras = {shot.camera for shot in shots}
    if len(cameras) >= MIN_CAMERAS:
        return hold_out_cameras(shots, (0,)), "camera 0 held out, by default: it is a new view"
    return hold_out_times(shots), (
        f"every {TEST_TIME_STEP}th time held out, by default: with {len(cameras)} of the "
        f"{MIN_CAMERAS} cameras it takes, none can be missed"
    )

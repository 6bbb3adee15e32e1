"""What a run will need, before it starts: time, memory and disk; what cannot fit is refused.

The figures are rounded measurements on two CPU cores (docs/guide/generate.md), within a factor of
two or so on other machines. They are per pixel of a frame, so they follow ``--resolution``.
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import ConfigError

BASE_BYTES = 5e8
"""The process itself: libraries and networks."""
SCENE_BYTES_PER_PX, SCENE_DISK_PER_PX, SCENE_SECONDS_PER_PX = 3500, 250, 2e-5
"""A generated scene has four Gaussians per pixel."""
DEPTH_COPIES, DEPTH_BYTES = 3, 4.0
"""Depth of all frames is kept, cleaned and read back again."""
GIF_BYTES_PER_PX = 4
VIDEO_DISK_PER_PX, DEPTH_DISK_PER_PX = 0.3, 4.0
FRAME_SECONDS_PER_PX = 1e-6
WORTH_SAYING_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEstimate:
    """Roughly what a run needs at most."""

    frames: int
    size_px: tuple[int, int]
    """(height, width)"""
    memory_bytes: float
    disk_bytes: float
    seconds: float

    def __str__(self) -> str:
        height, width = self.size_px
        return (
            f"{self.frames:,} frames of {width}×{height}: about {duration(self.seconds)} on two "
            f"cores, {gigabytes(self.memory_bytes)} of memory and {gigabytes(self.disk_bytes)} of "
            "disk"
        )


def estimate_frames(
    frames: int, size_px: tuple[int, int], with_depth: bool, gif: bool = False
) -> RunEstimate:
    """Rendering and writing frames of (height, width); ``gif`` keeps all of them."""
    pixels = frames * size_px[0] * size_px[1]
    memory = DEPTH_COPIES * DEPTH_BYTES * with_depth + GIF_BYTES_PER_PX * gif
    disk = VIDEO_DISK_PER_PX + DEPTH_DISK_PER_PX * with_depth
    return RunEstimate(
        frames=frames,
        size_px=size_px,
        memory_bytes=BASE_BYTES + pixels * memory,
        disk_bytes=pixels * disk,
        seconds=pixels * FRAME_SECONDS_PER_PX,
    )


def estimate_generation(
    frames: int, size_px: tuple[int, int], with_depth: bool, gif: bool = False
) -> RunEstimate:
    """The same with a scene made of an image of that size before."""
    shown, pixels = estimate_frames(frames, size_px, with_depth, gif), size_px[0] * size_px[1]
    return RunEstimate(
        frames=frames,
        size_px=size_px,
        memory_bytes=shown.memory_bytes + pixels * SCENE_BYTES_PER_PX,
        disk_bytes=shown.disk_bytes + pixels * SCENE_DISK_PER_PX,
        seconds=shown.seconds + pixels * SCENE_SECONDS_PER_PX,
    )


def require_fits(estimate: RunEstimate, folder: Path, advice: str) -> str | None:
    """A line about long work, None for short work; ``folder`` is where results go.

    Raises:
        ConfigError: it needs more memory than is free, or more disk.
    """
    memory, disk = free_memory_bytes(), free_disk_bytes(folder)
    if memory is not None and estimate.memory_bytes > memory:
        need, have = gigabytes(estimate.memory_bytes), gigabytes(memory)
        raise ConfigError(
            f"{estimate.frames:,} frames: expected at most {have} of memory, which are free, "
            f"got a need of {need}; {advice}"
        )
    if disk is not None and estimate.disk_bytes > disk:
        need, have = gigabytes(estimate.disk_bytes), gigabytes(disk)
        raise ConfigError(
            f"{estimate.frames:,} frames: expected at most {have} of disk, which are free in "
            f"{folder}, got a need of {need}; {advice}"
        )
    return str(estimate) if estimate.seconds > WORTH_SAYING_S else None


def free_memory_bytes() -> int | None:
    """What can be taken without swapping; None where the system does not say."""
    try:
        text = Path("/proc/meminfo").read_text()
    except OSError:
        return None
    found = [line.split()[1] for line in text.splitlines() if line.startswith("MemAvailable:")]
    return 1024 * int(found[0]) if found else None


def free_disk_bytes(folder: Path) -> int | None:
    """Free bytes where ``folder`` is or will be; None where the system does not say."""
    for place in (folder.absolute(), *folder.absolute().parents):
        try:
            usage = shutil.disk_usage(place)
            return usage.free if usage.total else None  # such as /proc: writing there says why not
        except FileNotFoundError:
            continue
        except OSError:
            return None
    return None


def gigabytes(count: float | int) -> str:
    """Bytes in words."""
    return f"{count / 1e9:.1f} GB" if count >= 1e8 else f"{count / 1e6:.0f} MB"


def duration(seconds: float) -> str:
    """Seconds in words."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"

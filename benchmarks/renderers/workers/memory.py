"""Resident memory of this process: now, at its peak, and a peak that can be set back.

``ru_maxrss`` is inherited from the parent on Linux, so that a child of a large process would seem
to grow by nothing; the kernel's VmHWM belongs to the process alone and can be set back to now.
Elsewhere the peak since the start has to do.
"""

import resource
from contextlib import suppress
from pathlib import Path

from diff4splat.progress.phases import peak_memory_bytes

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_MEMINFO = Path("/proc/meminfo")


def reset_peak() -> int:
    """Set the peak back to what is resident now, where that can be done; the peak after that."""
    # 5 means: reset the peak resident set size.
    with suppress(OSError):
        _CLEAR.write_text("5")
    return peak_bytes()


def peak_bytes() -> int:
    """The largest resident size since ``reset_peak``, or since the start."""
    return _kibibytes(_STATUS, "VmHWM") or peak_memory_bytes()


def available_bytes() -> int:
    """What the machine can still give; 4 GiB where it does not say."""
    return _kibibytes(_MEMINFO, "MemAvailable") or 4 << 30


def limit(limit_bytes: int) -> None:
    """Let allocations of this process beyond ``limit_bytes`` fail, instead of the machine."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, hard))


def _kibibytes(file: Path, name: str) -> int:
    with suppress(OSError):
        for line in file.read_text().splitlines():
            if line.startswith(f"{name}:"):
                return int(line.split()[1]) * 1024
    return 0

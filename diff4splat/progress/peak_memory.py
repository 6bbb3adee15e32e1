"""Peak memory of a part of a process: how far resident memory rose above where it began.

Linux alone can reset the peak of a process; elsewhere the peak is unknown.
"""

import ctypes
from pathlib import Path

RESET_PEAK = "5"
STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class PeakMemory:
    """As a context: ``peak_bytes`` after it, None where the system does not say."""

    def __init__(self) -> None:
        self.peak_bytes: int | None = None
        self._start: int | None = None

    def __enter__(self) -> "PeakMemory":
        try:
            # What was freed, but kept by the allocator, would hide what comes next.
            ctypes.CDLL(None).malloc_trim(0)
            CLEAR.write_text(RESET_PEAK)
            self._start = _status_bytes("VmRSS")
        except (OSError, AttributeError):
            self._start = None
        return self

    def __exit__(self, *error: object) -> None:
        if self._start is not None:
            self.peak_bytes = max(0, _status_bytes("VmHWM") - self._start)


def _status_bytes(name: str) -> int:
    for line in STATUS.read_text().splitlines():
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) * 1024
    raise OSError(f"{STATUS}: expected {name}, got none")

"""Seconds, processor seconds and peak memory of a run, from its first import on."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from diff4splat.progress.phases import peak_memory_bytes


@dataclass(frozen=True, kw_only=True)
class Stopwatch:
    """Where a run began."""

    wall_s: float
    cpu_s: float

    @classmethod
    def of_process(cls) -> "Stopwatch":
        """From the start of this process: imports count too."""
        return cls(wall_s=_process_start_s(), cpu_s=0.0)

    @classmethod
    def now(cls) -> "Stopwatch":
        """For one job of several in a process."""
        return cls(wall_s=time.time(), cpu_s=time.process_time())

    def read(self) -> dict[str, float | int]:
        """What the run took so far."""
        return {
            "seconds": round(time.time() - self.wall_s, 3),
            "cpu_seconds": round(time.process_time() - self.cpu_s, 3),
            "memory_bytes": peak_memory_bytes(),
        }


def _process_start_s() -> float:
    try:
        ticks = float(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        uptime_s = float(Path("/proc/uptime").read_text().split()[0])
        return time.time() - uptime_s + ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return time.time() - time.process_time()

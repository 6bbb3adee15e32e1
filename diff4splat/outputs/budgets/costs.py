"""What a command costs: rates times counted work, on this machine.

Work is counted before anything is loaded, as amounts by name (``matched_gaussians`` and so on).

    processor seconds = speed · Σ rate · amount
    seconds           = serial part + parallel part / cores that are free
    peak memory       = Σ bytes · amount
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import ConfigError

Work = Mapping[str, float | int]
PARALLEL = frozenset({"matched_gaussians", "filmed_gaussians", "filmed_pixels", "fitted_pixels"})
"""Work that runs on all cores; the rest runs on one."""
WORTH_SAYING_S = 5.0
FREE_CORES = "DIFF4SPLAT_FREE_CORES"
"""Environment variable: how many cores commands may count on, in place of a look at the load."""
MOST_CORES = 4096
KNOWN_BYTES = frozenset({"cached_bytes"})
"""Amounts that are bytes already: nothing is to be measured of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CostRates:
    """Rates of one command, by the name of the amount."""

    seconds: Mapping[str, float]
    """Processor seconds per unit on the machine of the calibration."""
    memory_bytes: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Forecast:
    """What a run is expected to need."""

    seconds: float
    cpu_seconds: float
    memory_bytes: float

    def __str__(self) -> str:
        return (
            f"about {duration(self.seconds)} ({duration(self.cpu_seconds)} of processor time) and "
            f"{gigabytes(self.memory_bytes)} of memory"
        )


def unknown_work(rates: CostRates, work: Work) -> tuple[str, ...]:
    """Amounts that no measured run had, so that nobody knows what they cost."""
    measured = rates.seconds.keys() | rates.memory_bytes.keys() | KNOWN_BYTES
    return tuple(name for name, amount in work.items() if amount > 0 and name not in measured)


def forecast(rates: CostRates, work: Work, speed: float, cores: float) -> Forecast:
    """The cost of ``work``; ``speed`` is how many times as slow as the calibration's machine."""
    parts = {name: speed * rate * work.get(name, 0.0) for name, rate in rates.seconds.items()}
    parallel = sum(value for name, value in parts.items() if name in PARALLEL)
    serial = sum(parts.values()) - parallel
    known = sum(work.get(name, 0.0) for name in KNOWN_BYTES)
    counted = sum(rate * work.get(name, 0.0) for name, rate in rates.memory_bytes.items())
    return Forecast(
        seconds=serial / min(cores, 1.0) + parallel / cores,
        cpu_seconds=serial + parallel,
        memory_bytes=known + counted,
    )


def free_cores(load: float | None = None, cores: int | None = None) -> float:
    """Cores that a command with a thread per core gets beside ``load`` other running threads.

    Raises:
        ConfigError: the environment names a number of cores that is none.
    """
    if load is None and (named := os.environ.get(FREE_CORES)):
        return _named_cores(named)
    count = cores or _own_cores()
    busy = other_load() if load is None else load
    return count * count / (count + max(busy, 0.0))


def other_load() -> float:
    """Threads that run beside this one: the mean of the last minute and of this moment."""
    try:
        fields = Path("/proc/loadavg").read_text().split()
        return (float(fields[0]) + int(fields[3].split("/")[0]) - 1) / 2
    except (OSError, ValueError, IndexError):
        return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0


def _named_cores(text: str) -> float:
    try:
        cores = float(text)
    except ValueError:
        cores = math.nan
    if not 0 < cores <= MOST_CORES:
        raise ConfigError(f"{FREE_CORES}: expected a number of cores, got {text[:40]!r}; unset it")
    return cores


def _own_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def duration(seconds: float) -> str:
    """Seconds in words."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    if seconds >= 90:
        return f"{seconds / 60:.0f} min"
    return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"


def gigabytes(count: float | int) -> str:
    """Bytes in words."""
    return f"{count / 1e9:.1f} GB" if count >= 1e8 else f"{count / 1e6:.0f} MB"

"""What the figures were measured on: processor, cores and versions, without a date."""

import os
import platform
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import torch

from diff4splat import __version__

_PACKAGES = ("numpy", "numba", "llvmlite", "gsplat", "mitsuba", "drjit")


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """A machine and what is installed on it."""

    processor: str
    cores: int
    memory_gib: float
    system: str
    python: str
    versions: dict[str, str]

    def __str__(self) -> str:
        packages = ", ".join(f"{name} {version}" for name, version in self.versions.items())
        return (
            f"{self.processor}, {self.cores} cores, {self.memory_gib:.0f} GiB, {self.system}, "
            f"Python {self.python}, {packages}"
        )


def this_machine() -> Description:
    """Describe the machine of this process."""
    versions = {"diff4splat": __version__, "torch": torch.__version__}
    for name in _PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return Description(
        processor=_processor(),
        cores=os.cpu_count() or 1,
        memory_gib=_memory_bytes() / 2**30,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        versions=versions,
    )


class Disturbance:
    """How much of the machine others used, from its making to ``cores``.

    Busy seconds of all cores, less those of this process and of its children that have ended.
    """

    def __init__(self) -> None:
        self._began, self._busy_s, self._own_s = time.monotonic(), _busy_s(), _own_s()

    def cores(self) -> float:
        """Cores kept busy by others, on average; 0 where the system does not tell."""
        others_s = (_busy_s() - self._busy_s) - (_own_s() - self._own_s)
        return max(0.0, others_s / (time.monotonic() - self._began))


def _busy_s() -> float:
    with suppress(OSError, ValueError, IndexError):
        fields = [int(word) for word in Path("/proc/stat").read_text().split("\n")[0].split()[1:]]
        # user, nice, system, idle, iowait, irq, softirq, steal
        return (sum(fields[:3]) + sum(fields[5:8])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def _own_s() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


def _memory_bytes() -> int:
    with suppress(ValueError, OSError, AttributeError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return 0

"""Progress and run time per phase of a long command, and the peak memory of the process.

A phase is a named part of the work with a known number of steps. Library code reports steps to a
``Phases`` object; the command line draws the progress bars.
"""

import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from diff4splat.progress.interrupts import raise_if_stopped

Advance = Callable[[], None]


def peak_memory_bytes() -> int:
    """Peak resident memory of this process in bytes."""
    # What the system counts per process starts with the size of the program that started it.
    peak = peak_of_status("/proc/self/status")
    if peak:
        return peak
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def peak_of_status(file: str) -> int:
    """Peak resident memory by a ``status`` file of Linux; 0 where there is none."""
    try:
        with open(file) as opened:
            found = [line.split()[1] for line in opened if line.startswith("VmHWM:")]
    except OSError:
        return 0
    return 1024 * int(found[0]) if found else 0


@dataclass(slots=True)
class Phases:
    """Collects seconds per phase; subclasses may draw progress bars."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str, steps: int = 1) -> Iterator[Advance]:
        """Time a phase; call the yielded function after each of its ``steps`` steps.

        Raises:
            KeyboardInterrupt: a stop was requested before a step or the end.
        """
        raise_if_stopped()
        start = time.perf_counter()
        with self.bar(name, steps) as advance:

            def finish_step() -> None:
                advance()
                raise_if_stopped()

            yield finish_step
            raise_if_stopped()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """Progress bar of one phase; silent in this class."""
        del name, steps
        yield lambda: None

"""Phases of a long command: how far each is, how long it took, and the peak memory of the process.

A phase is a named stretch of work with a known number of steps. Code that works reports steps to a
``Phases`` object and knows nothing about terminals; the command line draws the bars.
"""

import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Advance = Callable[[], None]


def peak_memory_bytes() -> int:
    """Largest resident size of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


@dataclass(slots=True)
class Phases:
    """Collects seconds per phase; subclasses may draw."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str, steps: int = 1) -> Iterator[Advance]:
        """Time a phase of ``steps`` steps; call the yielded function after each one."""
        began = time.perf_counter()
        with self.bar(name, steps) as advance:
            yield advance
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """Show progress of one phase; silent here."""
        del name, steps
        yield lambda: None

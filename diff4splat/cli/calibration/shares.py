"""Work in shares, two at a time, in processes with one thread each.

Timings of one share are disturbed little by the other; a share that stops keeps what it measured.
"""

import os
import queue
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

from diff4splat.progress.phases import Advance, Phases

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

PROCESSES = 2
LOOK_S = 0.2
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_steps: "list[Queue[str]]" = []
"""Of a process that runs shares: where it says that a step is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A part of the work; ``run`` is a function of a module, or a ``partial`` of one."""

    name: str
    steps: int
    run: Callable[[Phases], Any]


class _StepPhases(Phases):
    """Phases of a share: each step is counted where the shares were started."""

    def __init__(self, share: str) -> None:
        super().__init__()
        self.share = share

    @contextmanager
    def bar(self, name: str, steps: int) -> Iterator[Advance]:
        """No bar of its own."""
        del name, steps
        yield lambda: _steps[0].put(self.share)


def run_shares(shares: list[Share], phases: Phases) -> dict[str, Any]:
    """Results by name; the first ones start first. An error of one ends all."""
    context = get_context("spawn")
    steps = context.Queue()
    total = sum(share.steps for share in shares)
    with (
        _one_thread(),
        # Tensors of a result are read from the process that made them, so that has to stay.
        context.Pool(PROCESSES, _start, (steps,)) as pool,
        phases.phase("measure", total) as advance,
    ):
        waiting = {share.name: pool.apply_async(_run, (share,)) for share in shares}
        return _collected(waiting, {share.name: share.steps for share in shares}, steps, advance)


def _collected(
    waiting: dict[str, Any], left: dict[str, int], steps: "Queue[str]", advance: Advance
) -> dict[str, Any]:
    """Counts steps until all are done; what was known before counts with the end of its share."""
    done: dict[str, Any] = {}
    while waiting:
        _count(steps, left, advance)
        for name in [name for name, result in waiting.items() if result.ready()]:
            done[name] = waiting.pop(name).get()
            for _ in range(left.pop(name)):
                advance()
    return done


def _count(steps: "Queue[str]", left: dict[str, int], advance: Advance) -> None:
    try:
        name = steps.get(timeout=LOOK_S)
    except queue.Empty:
        return
    if left.get(name, 0) > 0:
        left[name] -= 1
        advance()


def _start(steps: "Queue[str]") -> None:
    """In each process: one that started the others hears of a stop, and ends them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _steps[:] = [steps]


def _run(share: Share) -> Any:
    return share.run(_StepPhases(share.name))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that are started inside have one thread each."""
    before: Mapping[str, str | None] = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value

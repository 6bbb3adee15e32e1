"""Makes batches in worker processes and replaces samples that cannot be used.

A sample that raises one of our errors is replaced by one that depends on its index alone: the same
on any machine and process count. Replacements are counted by reason. Workers are started afresh
rather than forked, because rasteriser threads do not survive a fork, and each computes on one
thread. They ignore Ctrl-C: the trainer decides when to stop.
"""

import atexit
import os
import signal
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from torch.utils.data import DataLoader, Dataset

from diff4splat.errors import Diff4SplatError, InputError
from diff4splat.training.stage import Batch
from diff4splat.training.trainer.loading.sampler import StepRange
from diff4splat.training.trainer.loading.samples import Samples, replacement

MOST_ATTEMPTS = 10
"""Unusable samples in a row before a run gives up: then the source is broken, not a sample."""
_ONE_THREAD = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A sample that was replaced."""

    sample: int
    reason: str
    """Kind of error and what was expected: equal for equal causes."""
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """A micro batch; None when nothing usable was found."""

    batch: Batch | None
    failures: tuple[Failure, ...]
    waited_s: float = 0.0


def load_batch(samples: Samples, indices: Sequence[int]) -> Loaded:
    """Samples at the indices or in their place; never raises our own errors."""
    found, failures = [], []
    for index in indices:
        for attempt in range(MOST_ATTEMPTS):
            try:
                found.append(samples[replacement(index, attempt)])
                break
            except Diff4SplatError as error:
                failures.append(_failure(index, error))
        else:
            return Loaded(batch=None, failures=tuple(failures))
    return Loaded(batch=samples.collate(found), failures=tuple(failures))


def require_batch(loaded: Loaded) -> Batch:
    """The batch.

    Raises:
        InputError: every replacement failed as well.
    """
    if loaded.batch is None:
        reasons = Counter(failure.reason for failure in loaded.failures)
        listed = "; ".join(f"{count} × {reason}" for reason, count in reasons.most_common())
        raise InputError(
            f"{loaded.failures[-1].message} (sample {loaded.failures[-1].sample}: expected a "
            f"usable one among {MOST_ATTEMPTS} tries, got {listed}; check the data source)"
        )
    return loaded.batch


def batches(samples: Samples, steps: StepRange, workers: int) -> Iterator[Loaded]:
    """Micro batches in order, with the time that was spent waiting for each."""
    loader = DataLoader(
        _Lists(samples),
        batch_size=None,
        sampler=steps,
        num_workers=workers,
        multiprocessing_context="spawn" if workers else None,
        worker_init_fn=_begin_worker if workers else None,
    )
    with _one_thread():
        ready = iter(loader)
    while True:
        began = time.perf_counter()
        loaded = next(ready, None)
        if loaded is None:
            return
        waited_s = time.perf_counter() - began
        yield Loaded(batch=loaded.batch, failures=loaded.failures, waited_s=waited_s)


class _Lists(Dataset):
    """Index lists to micro batches; a module-level class, because workers unpickle it."""

    def __init__(self, samples: Samples) -> None:
        self._samples = samples

    def __getitem__(self, indices: Any) -> Loaded:
        return load_batch(self._samples, indices)


def _failure(index: int, error: Diff4SplatError) -> Failure:
    message = " ".join(str(error).split())
    expected = message.partition(": expected ")[2].partition(", got")[0]
    reason = type(error).__name__ + (f": expected {expected}" if expected else "")
    return Failure(sample=index, reason=reason, message=message)


def _begin_worker(worker: int) -> None:
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker that is stopped amid a sample must just go: taken apart while its threads still
    # compute, it would abort, and the run would report a crash that is none.
    atexit.register(os._exit, 0)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Children started inside compute on one thread each; libraries read this when they load."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value

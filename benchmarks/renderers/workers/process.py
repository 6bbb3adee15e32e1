"""One worker process: a fresh interpreter that holds an object whose methods the parent calls.

Fresh, so that memory and threads are its own; the parent asks one worker at a time, so that no two
renderers ever compute at once. A worker that fails, dies, takes too long or wants too much memory
gives a ``WorkerFailure`` with the reason in one line, and the comparison goes on.
"""

import contextlib
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

THREAD_VARIABLES = (
    *("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"),
)
_LONGEST_REASON = 160
_NO_MEMORY = ("can't allocate memory", "bad_alloc", "out of memory", "cannot allocate memory")


class WorkerFailure(Exception):  # noqa: N818  a reason for the table, not an error of ours
    """Why a worker has no answer, in one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one worker may use."""

    threads: int
    memory_bytes: int
    answer_s: float
    """How long one answer may take before the worker is stopped."""


class Worker:
    """A process that holds ``make()``; ``close`` it, or use it in a ``with``."""

    def __init__(self, make: Callable[[], object], limits: Limits) -> None:
        self._limits = limits
        handle, log = tempfile.mkstemp(prefix="renderer-", suffix=".log")
        os.close(handle)
        self._log = Path(log)
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(make, theirs, limits, self._log), daemon=True
        )
        with _threads(limits.threads):
            self._process.start()
        # With our copy open, the death of the worker would never end the pipe.
        theirs.close()

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, method: str, *arguments: Any) -> Any:
        """The result of one method.

        Raises:
            WorkerFailure: it raised, died, or took longer than ``answer_s``.
        """
        try:
            self._connection.send((method, arguments))
            if not self._connection.poll(self._limits.answer_s):
                self.close()
                raise WorkerFailure(f"stopped: no answer within {self._limits.answer_s:.0f} s")
            worked, answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise WorkerFailure(self._death()) from error
        if not worked:
            raise WorkerFailure(answer)
        return answer

    def close(self) -> None:
        """End the process; once is enough, more does no harm."""
        self._process.kill()
        self._process.join()
        self._connection.close()
        self._log.unlink(missing_ok=True)

    def _death(self) -> str:
        self._process.join()
        code = self._process.exitcode or 0
        words = self._log.read_text(errors="replace").split("\n") if self._log.exists() else []
        last = next((line.strip() for line in reversed(words) if line.strip()), "")
        if code == -signal.SIGKILL:
            return "killed by the system, most likely for lack of memory"
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return f"died ({how}) {last}".strip()[:_LONGEST_REASON]


def _serve(make: Callable[[], object], pipe: Connection, limits: Limits, log: Path) -> None:
    """The life of a worker: answer until the pipe ends."""
    # The parent decides when an interrupt ends a worker.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _redirect(log)
    import torch

    from workers import memory

    torch.set_num_threads(limits.threads)
    memory.limit(limits.memory_bytes)
    subject = make()
    while True:
        try:
            method, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = (True, getattr(subject, method)(*arguments))
        except Exception as error:
            answer = (False, explain(error, limits.memory_bytes))
        pipe.send(answer)


def explain(error: Exception, memory_bytes: int) -> str:
    """One line for the table."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) or any(hint in text.lower() for hint in _NO_MEMORY):
        return f"out of memory (limit {memory_bytes / 2**30:.1f} GiB)"
    return f"{type(error).__name__}: {text}"[:_LONGEST_REASON]


def _redirect(log: Path) -> None:
    """Whatever a library prints goes to the log, not into the table."""
    file = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(file, 1)
    os.dup2(file, 2)


@contextlib.contextmanager
def _threads(count: int) -> Iterator[None]:
    """The environment that a fresh interpreter inherits: thread counts, and waiting that sleeps."""
    wanted = dict.fromkeys(THREAD_VARIABLES, str(count)) | {"OMP_WAIT_POLICY": "PASSIVE"}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value

"""One worker process, as the server sees it: warm before its task, gone after it."""

import asyncio
import contextlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from diff4splat.serving.workers.protocol import Task, parse_message

LOOK_S = 0.25
"""Between looks at a worker's memory."""
LINE_BYTES = 1 << 20


class TaskRefusedError(Exception):
    """The generation says what is wrong with its input."""


class WorkerDiedError(Exception):
    """The process ended without a result."""


class TooMuchMemoryError(Exception):
    """The process grew beyond the limit and was stopped."""


class Worker:
    """A process that imports everything at once and then waits for one task."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process

    @classmethod
    async def start(cls, command: Sequence[str], folder: Path) -> "Worker":
        """Start the process in ``folder``, where it finds no file that a name could mean."""
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            cwd=folder,
            limit=LINE_BYTES,
        )
        return cls(process)

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.returncode is None

    @property
    def process_id(self) -> int:
        """Of the process."""
        return self._process.pid

    async def run(
        self, task: Task, limit_bytes: int, report: Callable[[str, int, int], None]
    ) -> None:
        """Hand over the task and follow it; ``report`` gets phase, steps done and steps.

        Raises:
            TaskRefusedError: the input cannot be used.
            WorkerDiedError, TooMuchMemoryError: there is no result.
        """
        with contextlib.suppress(ConnectionError):
            self._process.stdin.write(task.to_line())
            await self._process.stdin.drain()
        watch = asyncio.create_task(self._watch_memory(limit_bytes))
        try:
            await self._follow(report)
        finally:
            watch.cancel()
            exceeded = watch.done() and not watch.cancelled() and watch.result()
            if exceeded:
                raise TooMuchMemoryError

    async def stop(self) -> None:
        """End the process, whatever it does."""
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        await self._process.wait()

    async def _follow(self, report: Callable[[str, int, int], None]) -> None:
        while line := await self._process.stdout.readline():
            found = parse_message(line)
            if "phase" in found:
                report(str(found["phase"]), int(found["done"]), int(found["steps"]))
            elif "refused" in found:
                raise TaskRefusedError(str(found["refused"]))
            elif found.get("ended"):
                return
        raise WorkerDiedError

    async def _watch_memory(self, limit_bytes: int) -> bool:
        """Stop the process when it grows beyond the limit; returns whether it did."""
        while self.alive:
            if resident_bytes(self._process.pid) > limit_bytes:
                self._process.kill()
                return True
            await asyncio.sleep(LOOK_S)
        return False


def resident_bytes(process_id: int) -> int:
    """Resident memory of a process; 0 where the system does not say."""
    try:
        pages = int(Path(f"/proc/{process_id}/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")

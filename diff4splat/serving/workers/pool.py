"""Workers for the jobs of a queue: one task each, the next one warm before it is needed."""

import asyncio
from collections.abc import Sequence
from pathlib import Path

from diff4splat.serving.jobs.job import Job
from diff4splat.serving.jobs.queue import JobQueue
from diff4splat.serving.workers.protocol import Task
from diff4splat.serving.workers.worker import (
    TaskRefusedError,
    TooMuchMemoryError,
    Worker,
    WorkerDiedError,
)

SHORT_S = 0.01


class WorkerPool:
    """As many generations at a time as the settings allow."""

    def __init__(self, queue: JobQueue, command: Sequence[str]) -> None:
        self.queue, self.settings = queue, queue.settings
        self._command = command
        self._running: dict[str, asyncio.Task] = {}
        self._slots: list[asyncio.Task] = []

    def start(self) -> None:
        """Take up jobs from now on."""
        slots = range(self.settings.workers)
        self._slots = [asyncio.create_task(self._work()) for _ in slots]

    async def cancel(self, job: Job) -> None:
        """Cancel a job that waits or runs; nothing happens to one that has ended."""
        if await self.queue.cancel_waiting(job):
            return
        if task := self._running.get(job.identifier):
            task.cancel()
            while not job.ended:
                await asyncio.sleep(SHORT_S)

    async def stop(self) -> None:
        """Let running jobs end within the time of grace; the others wait for the next start."""
        self.queue.closed = True
        running = list(self._running.values())
        if running:
            await asyncio.wait(running, timeout=self.settings.grace_s)
        for slot in self._slots:
            slot.cancel()
        await asyncio.gather(*self._slots, return_exceptions=True)

    async def _work(self) -> None:
        """One slot: a warm worker, then a job, over and over."""
        folder = self.queue.folders.folder
        worker = await Worker.start(self._command, folder)
        try:
            while not self.queue.closed:
                job = await self.queue.take()
                if not worker.alive:
                    worker = await Worker.start(self._command, folder)
                await self._one(worker, job)
                await worker.stop()
                worker = await Worker.start(self._command, folder)
        finally:
            await worker.stop()

    async def _one(self, worker: Worker, job: Job) -> None:
        """Run a job as a task of its own, which a client may cancel."""
        task = asyncio.create_task(self._attempt(worker, job))
        self._running[job.identifier] = task
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            if not task.cancelled():
                # The server stops: the job waits for its return.
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
                job.state = "queued"
                job.attempts -= 1
                self.queue.store.update(job)
                raise
            if not job.ended:
                await self.queue.end(job, "cancelled")
        finally:
            del self._running[job.identifier]

    async def _attempt(self, worker: Worker, job: Job) -> None:
        settings, folders = self.settings, self.queue.folders
        task = Task(
            photo=_absolute(folders.photo(job)),
            out=_absolute(folders.result(job)),
            preview=_absolute(folders.preview(job)),
            model=settings.model,
            options=job.options,
        )

        def report(phase: str, done: int, steps: int) -> None:
            job.phase, job.progress = phase, (done, steps)

        try:
            async with asyncio.timeout(settings.job_s):
                await worker.run(task, settings.job_bytes, report)
        except TaskRefusedError as error:
            await self.queue.end(job, "failed", str(error))
        except TooMuchMemoryError:
            limit = f"{settings.job_bytes / 1e9:.1f} GB"
            await self.queue.end(job, "failed", f"it needs more than {limit}; ask for less")
        except TimeoutError:
            limit = f"{settings.job_s:.0f} s"
            await self.queue.end(job, "failed", f"it takes longer than {limit}; ask for less")
        except WorkerDiedError:
            await self.queue.again(job)
        else:
            await self.queue.end(job, "done")


def _absolute(path: Path) -> str:
    """Workers stand in another folder."""
    return str(path.resolve())

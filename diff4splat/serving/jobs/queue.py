"""The jobs of a server in memory and on disk: accept, take, end, cancel, recover.

All methods run in the event loop's thread; only the disk is waited for elsewhere.
"""

import asyncio
import time
from collections import deque

from diff4splat.serving.jobs.folders import DATABASE, JobFolders
from diff4splat.serving.jobs.job import Job, State, new_identifier
from diff4splat.serving.jobs.store import JobStore
from diff4splat.serving.settings import ServerSettings


class QueueFullError(Exception):
    """More jobs wait than the server allows."""


class JobQueue:
    """Every job that is known, and which of them wait."""

    def __init__(self, settings: ServerSettings) -> None:
        self.settings = settings
        self.folders = JobFolders(settings.folder)
        self.store = JobStore(settings.folder / DATABASE)
        self.jobs: dict[str, Job] = {}
        self._waiting: deque[Job] = deque()
        self._arrived = asyncio.Event()
        self._accepting = 0
        self.closed = False
        self._recover()

    @property
    def waiting(self) -> int:
        """How many jobs wait."""
        return len(self._waiting)

    def position(self, job: Job) -> int:
        """How many jobs wait before this one."""
        return self._waiting.index(job) if job in self._waiting else 0

    def count(self, state: State) -> int:
        """How many jobs are in a state."""
        return sum(job.state == state for job in self.jobs.values())

    async def accept(self, options: dict[str, object], photo: bytes) -> Job:
        """Keep a new job on disk and queue it.

        Raises:
            QueueFullError: too many wait, or the server is about to stop.
        """
        if self.closed or self.waiting + self._accepting >= self.settings.queue_limit:
            raise QueueFullError
        job = Job(identifier=new_identifier(), options=options, created_s=time.time())
        self._accepting += 1
        try:
            await asyncio.to_thread(self.folders.accept, job, photo)
            await asyncio.to_thread(self.store.add, job)
        finally:
            self._accepting -= 1
        self.jobs[job.identifier] = job
        self._waiting.append(job)
        self._arrived.set()
        return job

    async def take(self) -> Job:
        """Wait for a job and start it."""
        while not self._waiting:
            self._arrived.clear()
            await self._arrived.wait()
        job = self._waiting.popleft()
        job.state, job.attempts, job.started_s = "running", job.attempts + 1, time.time()
        job.phase, job.progress = "start", (0, 0)
        await asyncio.to_thread(self._start, job)
        return job

    async def end(self, job: Job, state: State, error: str = "") -> None:
        """A job that is over."""
        job.state, job.error, job.ended_s, job.phase = state, error, time.time(), ""
        job.results = self.folders.results(job) if state == "done" else ()
        await asyncio.to_thread(self.store.update, job)
        await asyncio.to_thread(self._remove_oldest)

    async def again(self, job: Job) -> None:
        """Put a job back in front of the others, unless it was started too often."""
        if job.attempts >= self.settings.attempts:
            why = f"its worker ended {job.attempts} times without a result; try a smaller image"
            await self.end(job, "failed", why)
            return
        job.state, job.phase, job.progress = "queued", "", (0, 0)
        self._waiting.appendleft(job)
        await asyncio.to_thread(self.store.update, job)
        self._arrived.set()

    async def cancel_waiting(self, job: Job) -> bool:
        """Cancel a job that has not started; False if it has."""
        if job not in self._waiting:
            return False
        self._waiting.remove(job)
        await self.end(job, "cancelled")
        return True

    def _start(self, job: Job) -> None:
        self.folders.discard_result(job)
        self.store.update(job)

    def _recover(self) -> None:
        """Jobs of an earlier run: results that are whole count, what was running starts anew."""
        for job in self.store.read():
            self.jobs[job.identifier] = job
            if job.state == "running" and self.folders.results(job):
                job.state, job.ended_s = "done", time.time()
                job.results = self.folders.results(job)
                self.store.update(job)
            elif not job.ended and not self.folders.photo(job).is_file():
                job.state, job.error = "failed", "its photograph was deleted; send it again"
                self.store.update(job)
            elif not job.ended:
                # The server was stopped: that start does not count against the job.
                job.attempts -= job.state == "running"
                job.state = "queued"
                self._waiting.append(job)
        self.folders.remove_unknown(set(self.jobs))

    def _remove_oldest(self) -> None:
        ended = [job for job in list(self.jobs.values()) if job.ended]
        for job in ended[: max(len(ended) - self.settings.keep_jobs, 0)]:
            self.folders.remove(job.identifier)
            self.store.remove(job.identifier)
            self.jobs.pop(job.identifier, None)

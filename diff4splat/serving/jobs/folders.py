"""Files of jobs.

    FOLDER/jobs.sqlite
    FOLDER/jobs/<identifier>/{photo, preview.png, result/<file>…}

No part of a path comes from a client: names of results are looked up in a list.
"""

import os
import shutil
from pathlib import Path

from diff4splat.outputs.file_names import OUTPUT_FILES
from diff4splat.serving.jobs.job import Job

DATABASE, JOBS = "jobs.sqlite", "jobs"


class JobFolders:
    """The folders of all jobs of a server."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / JOBS
        self.folder.mkdir(parents=True, exist_ok=True)

    def of(self, job: Job) -> Path:
        """The folder of a job."""
        return self.folder / job.identifier

    def photo(self, job: Job) -> Path:
        """What the client sent."""
        return self.of(job) / "photo"

    def result(self, job: Job) -> Path:
        """Where the worker writes; its files appear there together."""
        return self.of(job) / "result"

    def preview(self, job: Job) -> Path:
        """One frame, while the others are rendered."""
        return self.of(job) / "preview.png"

    def accept(self, job: Job, photo: bytes) -> None:
        """Write the photograph, and wait until the disk has it."""
        self.of(job).mkdir()
        with self.photo(job).open("wb") as file:
            file.write(photo)
            file.flush()
            os.fsync(file.fileno())

    def results(self, job: Job) -> tuple[str, ...]:
        """Names of the files of a whole result; none if it is not whole."""
        present = [name for name in OUTPUT_FILES if (self.result(job) / name).is_file()]
        return tuple(present) if "card.json" in present else ()

    def discard_result(self, job: Job) -> None:
        """Before a job starts anew."""
        shutil.rmtree(self.result(job), ignore_errors=True)
        self.preview(job).unlink(missing_ok=True)

    def remove(self, identifier: str) -> None:
        """Everything of a job."""
        shutil.rmtree(self.folder / identifier, ignore_errors=True)

    def remove_unknown(self, known: set[str]) -> None:
        """Folders of requests that were never accepted."""
        for folder in self.folder.iterdir():
            if folder.name not in known:
                shutil.rmtree(folder, ignore_errors=True)

"""Jobs in SQLite: what was accepted is on disk before the client hears of it."""

import json
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from diff4splat.errors import OutputError
from diff4splat.serving.jobs.job import Job

_COLUMNS = (
    "identifier", "state", "options", "attempts", "error",
    "created_s", "started_s", "ended_s", "results",
)  # fmt: skip
_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    identifier TEXT NOT NULL UNIQUE,
    state TEXT NOT NULL,
    options TEXT NOT NULL,
    attempts INTEGER NOT NULL,
    error TEXT NOT NULL,
    created_s REAL NOT NULL,
    started_s REAL NOT NULL,
    ended_s REAL NOT NULL,
    results TEXT NOT NULL
);
"""


class JobStore:
    """The jobs of one server; safe from any thread.

    Raises:
        OutputError: the database cannot be opened or is damaged.
    """

    def __init__(self, file: Path) -> None:
        self._lock = threading.Lock()
        try:
            self._connection = sqlite3.connect(file, check_same_thread=False, isolation_level=None)
            # A power cut loses no accepted job.
            self._connection.execute("PRAGMA journal_mode=WAL")
            self._connection.execute("PRAGMA synchronous=FULL")
            self._connection.executescript(_SCHEMA)
        except sqlite3.DatabaseError as error:
            raise OutputError(
                f"{file}: expected a database of jobs, got something else ({error}); "
                "name another folder or delete the file"
            ) from error

    def add(self, job: Job) -> None:
        """Keep a new job."""
        marks = ", ".join("?" * len(_COLUMNS))
        with self._cursor() as cursor:
            statement = f"INSERT INTO jobs ({', '.join(_COLUMNS)}) VALUES ({marks})"
            cursor.execute(statement, _row(job))

    def update(self, job: Job) -> None:
        """Keep the present state of a job."""
        settings = ", ".join(f"{column} = ?" for column in _COLUMNS)
        with self._cursor() as cursor:
            statement = f"UPDATE jobs SET {settings} WHERE identifier = ?"
            cursor.execute(statement, (*_row(job), job.identifier))

    def read(self) -> list[Job]:
        """All jobs in the order of arrival."""
        with self._cursor() as cursor:
            rows = cursor.execute(f"SELECT {', '.join(_COLUMNS)} FROM jobs ORDER BY number")
            return [_job(row) for row in rows.fetchall()]

    def remove(self, identifier: str) -> None:
        """Forget a job."""
        with self._cursor() as cursor:
            cursor.execute("DELETE FROM jobs WHERE identifier = ?", (identifier,))

    def close(self) -> None:
        """Write everything back into one file."""
        with self._lock:
            self._connection.close()

    @contextmanager
    def _cursor(self) -> Iterator[sqlite3.Cursor]:
        with self._lock:
            yield self._connection.cursor()


def _row(job: Job) -> tuple[object, ...]:
    values = {name: getattr(job, name) for name in _COLUMNS}
    values |= {"options": json.dumps(job.options), "results": json.dumps(job.results)}
    return tuple(values[name] for name in _COLUMNS)


def _job(row: tuple) -> Job:
    values = dict(zip(_COLUMNS, row, strict=True))
    values["options"] = json.loads(values["options"])
    values["results"] = tuple(json.loads(values["results"]))
    return Job(**values)

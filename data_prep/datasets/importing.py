"""A copy of a data set into a folder of shards; what is unusable becomes a row of a report."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from diff4splat.data.codecs.encode import Coding
from diff4splat.data.manifest import ensure_manifest
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.datasets.common.sequence import ListedSequence
from diff4splat.data_prep.datasets.common.windows import WindowOptions
from diff4splat.data_prep.datasets.registry import (
    ListedClip,
    clips_of,
    find_dataset,
    list_sequences,
)
from diff4splat.data_prep.rows import ReportRow, failed_row, write_rows
from diff4splat.errors import InputError, MissingExtraError, OutputError
from diff4splat.progress.phases import Phases

REPORT = "report.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportJob:
    """What to read and where to write."""

    root: Path
    dataset: str
    folder: Path
    windows: WindowOptions = field(default_factory=WindowOptions)
    coding: Coding = field(default_factory=Coding)
    most_sequences: int | None = None
    append: bool = False
    task: int = 0
    """Which of ``tasks`` parts to import: every sequence belongs to one, by its name."""
    tasks: int = 1


def import_dataset(job: ImportJob, phases: Phases) -> tuple[ReportRow, ...]:
    """Write every usable clip; the rows are also in ``report.csv`` beside the shards.

    Raises:
        InputError, FileFormatError: nothing of the data set is there, or its list is damaged.
        OutputError: the folder has clips and ``append`` is False, or cannot be written.
        MissingExtraError: the format needs a package that is not installed.
    """
    dataset = find_dataset(job.dataset)
    listed = of_task(list_sequences(dataset, job.root)[: job.most_sequences], job)
    options = ShardOptions(generator=f"import of {dataset.facts.title}", coding=job.coding)
    rows: list[ReportRow] = []
    with ShardWriter(job.folder, options, job.append) as writer:
        try:
            with phases.phase("import", len(listed)) as advance:
                for sequence in listed:
                    rows += _imported(sequence, job, writer)
                    advance()
        finally:
            write_rows(rows, job.folder / REPORT)
    ensure_manifest(job.folder, options.generator)
    return tuple(rows)


def of_task(listed: list[ListedSequence], job: ImportJob) -> list[ListedSequence]:
    """The sequences of one task; they do not depend on the order in which a disk lists them."""
    if job.tasks == 1:
        return listed
    chosen = [one for one in listed if _task_of(one.name, job.tasks) == job.task]
    return sorted(chosen, key=lambda one: one.name)


def _task_of(name: str, tasks: int) -> int:
    digest = hashlib.sha256(name.encode(errors="replace")).digest()
    return int.from_bytes(digest[:8], "big") % tasks


def _imported(listed: ListedSequence, job: ImportJob, writer: ShardWriter) -> Iterator[ReportRow]:
    """One row per clip; a sequence that cannot be opened has one row."""
    try:
        for clip in clips_of(listed, find_dataset(job.dataset), job.windows):
            yield _written(listed.name, clip, writer)
    except (OutputError, MissingExtraError):
        raise
    except Exception as error:  # one damaged sequence must not end a run of days
        yield failed_row(listed.name, "", error)


def _written(sequence: str, clip: ListedClip, writer: ShardWriter) -> ReportRow:
    if clip.identifier in writer.identifiers:
        return ReportRow(sequence=sequence, clip=clip.identifier, status="present")
    try:
        writer.write(clip.read())
    except (OutputError, MissingExtraError):
        raise
    except Exception as error:  # as above
        return failed_row(sequence, clip.identifier, error)
    return ReportRow(sequence=sequence, clip=clip.identifier, status="written")


def summary(rows: tuple[ReportRow, ...]) -> str:
    """How many clips were written, present and unusable, and the first reason.

    Raises:
        InputError: not one clip is usable; with the first reason.
    """
    counts = Counter(row.status for row in rows)
    failed = next((row for row in rows if row.status == "failed"), None)
    if failed is not None and counts["failed"] == len(rows):
        raise InputError(f"expected usable clips, got none of {len(rows)}: {failed.message}")
    text = f"{counts['written']} clips written, {counts['present']} present"
    if failed is None:
        return text
    return f"{text}, {counts['failed']} unusable; the first: {failed.message}"

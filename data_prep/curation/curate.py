"""A curation: score what has no scores yet, decide, and write tables.

Files in the output folder: ``scores.jsonl`` (one record per clip), ``decisions.csv``,
``selected.txt`` (identifiers), ``thresholds.toml`` (as used).
"""

import csv
import hashlib
import io
import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import torch

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.curation.clip_record import SCORING_VERSION, ClipRecord
from diff4splat.data_prep.curation.decisions import Decision, decide
from diff4splat.data_prep.curation.hooks import NO_HOOKS, Hooks, load_hook
from diff4splat.data_prep.curation.record_store import RecordStore
from diff4splat.data_prep.curation.scoring import score_stored_clip
from diff4splat.data_prep.curation.thresholds import FILE_NAME, Thresholds
from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.io.atomic import write_text
from diff4splat.progress.phases import Phases

DECISIONS, SELECTED = "decisions.csv", "selected.txt"
_COLUMNS = ("folder", "clip", "dataset", "selected", "stage", "reason", "detail")


@dataclass(frozen=True, slots=True, kw_only=True)
class CurationJob:
    """What is curated, by which thresholds, and where the tables go."""

    folders: tuple[Path, ...]
    out: Path
    thresholds: Thresholds
    hooks: Hooks = NO_HOOKS
    workers: int = 1

    def __post_init__(self) -> None:
        names = [folder.resolve().name for folder in self.folders]
        if not names or len(set(names)) != len(names):
            raise ConfigError(
                f"prepare curate: expected folders of different names, got {', '.join(names)}; "
                "rename one"
            )


def curate(job: CurationJob, phases: Phases) -> list[Decision]:
    """Score, decide and write the tables.

    Raises:
        InputError: there is no clip.
        FileFormatError: a folder of shards is damaged as a whole.
        OutputError: the output folder cannot be written.
    """
    folders = {folder.resolve().name: ClipFolder(folder) for folder in job.folders}
    if not any(len(folder) for folder in folders.values()):
        raise InputError(f"{job.folders[0]}: expected clips, got none; import or prepare some")
    if job.hooks.quality:
        load_hook(job.hooks.quality)
    records = _scored(job, folders, phases)
    decisions = decide(records, job.thresholds)
    _write_tables(job, decisions)
    return decisions


def _scored(job: CurationJob, folders: dict[str, ClipFolder], phases: Phases) -> list[ClipRecord]:
    store = RecordStore(job.out)
    present = store.read()
    empty = [record for name in folders for record in _empty(name, folders[name], job.hooks)]
    waiting = [
        (position, record)
        for position, record in empty
        if record.key not in present or present[record.key].checksum != record.checksum
    ]
    with phases.phase("score clips", len(waiting)) as advance:
        for record in _results(job, folders, waiting):
            store.append(record)
            present[record.key] = record
            advance()
    records = [present[record.key] for _, record in empty]
    store.rewrite(records)
    return records


def _empty(name: str, folder: ClipFolder, hooks: Hooks) -> Iterator[tuple[int, ClipRecord]]:
    """Position and record without scores of every clip."""
    for position, entry in enumerate(folder.entries):
        text = f"{SCORING_VERSION} {hooks.quality} {_stored_checksum(folder, position)}"
        yield (
            position,
            ClipRecord(
                identifier=entry.identifier,
                folder=name,
                dataset=entry.dataset,
                scene=entry.scene,
                license=entry.license,
                is_static=entry.is_static,
                checksum=hashlib.sha256(text.encode()).hexdigest()[:16],
            ),
        )


def _stored_checksum(folder: ClipFolder, position: int) -> str:
    """A damaged index gives its clips an error each, when they are read, and stops nothing."""
    try:
        return folder.checksum(position)
    except FileFormatError:
        return "damaged"


def _results(
    job: CurationJob, folders: dict[str, ClipFolder], waiting: list[tuple[int, ClipRecord]]
) -> Iterator[ClipRecord]:
    if job.workers == 1 or len(waiting) < 2:
        for position, record in waiting:
            yield score_stored_clip(folders[record.folder], position, record, job.hooks)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(job.workers, context, initializer=_begin_worker)
    queue: list[Future[ClipRecord]] = []
    try:
        for position, record in waiting:
            folder = folders[record.folder]
            queue.append(pool.submit(score_stored_clip, folder, position, record, job.hooks))
            # A few ahead keep the workers busy without a list of every clip in flight.
            if len(queue) > 2 * job.workers:
                yield queue.pop(0).result()
        for future in queue:
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """One thread each; Ctrl-C is for the process that writes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    torch.set_num_threads(1)


def _write_tables(job: CurationJob, decisions: list[Decision]) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows(_row(decision) for decision in decisions)
    write_text(job.out / DECISIONS, text.getvalue())
    selected = [each.record.identifier for each in decisions if each.is_selected]
    write_text(job.out / SELECTED, "".join(f"{name}\n" for name in selected))
    write_text(job.out / FILE_NAME, job.thresholds.text)


def _row(decision: Decision) -> tuple[str, ...]:
    record = decision.record
    first = decision.reasons[0] if decision.reasons else None
    return (
        record.folder,
        record.identifier,
        record.dataset,
        "yes" if decision.is_selected else "no",
        first.stage if first else "",
        first.text if first else "",
        "; ".join(reason.detail for reason in decision.reasons),
    )

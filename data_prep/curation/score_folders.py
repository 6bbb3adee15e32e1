"""Scores of every clip of some folders: measured once, kept on the disk, taken up after a stop.

Scores may also lie in a folder of shards itself, where a task of a pipeline left them.
"""

import hashlib
import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import torch

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.curation.clip_record import SCORING_VERSION, ClipRecord
from diff4splat.data_prep.curation.hooks import NO_HOOKS, Hooks, load_hook
from diff4splat.data_prep.curation.record_store import RecordStore
from diff4splat.data_prep.curation.scoring import score_stored_clip
from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.progress.phases import Phases


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoringJob:
    """Which clips, and where their scores go."""

    folders: tuple[Path, ...]
    out: Path
    """Folder of ``scores.jsonl``."""
    hooks: Hooks = NO_HOOKS
    workers: int = 1

    def __post_init__(self) -> None:
        names = [folder.resolve().name for folder in self.folders]
        if not names or len(set(names)) != len(names):
            raise ConfigError(
                f"prepare curate: expected folders of different names, got {', '.join(names)}; "
                "rename one"
            )


def score_folders(job: ScoringJob, phases: Phases) -> list[ClipRecord]:
    """A record per clip, in the order of the folders.

    Raises:
        ConfigError: the quality model cannot be loaded.
        FileFormatError: a folder of shards is damaged as a whole.
        OutputError: the output folder cannot be written.
    """
    if job.hooks.quality:
        load_hook(job.hooks.quality)
    folders = {folder.resolve().name: ClipFolder(folder) for folder in job.folders}
    store, present = RecordStore(job.out), _present(job)
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


def _present(job: ScoringJob) -> dict[tuple[str, str], ClipRecord]:
    """Scores of earlier runs; those in the output folder come last and count."""
    found: dict[tuple[str, str], ClipRecord] = {}
    for folder in (*job.folders, job.out):
        found |= RecordStore(folder).read()
    return found


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
    job: ScoringJob, folders: dict[str, ClipFolder], waiting: list[tuple[int, ClipRecord]]
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

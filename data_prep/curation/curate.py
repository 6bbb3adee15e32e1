"""A curation: score what has no scores yet, decide, and write tables.

Files in the output folder: ``scores.jsonl`` (one record per clip), ``decisions.csv``,
``selected.txt`` (identifiers), ``thresholds.toml`` (as used).
"""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data_prep.curation.decisions import Decision, decide
from diff4splat.data_prep.curation.score_folders import ScoringJob, score_folders
from diff4splat.data_prep.curation.thresholds import FILE_NAME, Thresholds
from diff4splat.errors import InputError
from diff4splat.io.atomic import write_text
from diff4splat.progress.phases import Phases

DECISIONS, SELECTED = "decisions.csv", "selected.txt"
_COLUMNS = ("folder", "clip", "dataset", "selected", "stage", "reason", "detail")


@dataclass(frozen=True, slots=True, kw_only=True)
class CurationJob:
    """What is curated, by which thresholds, and where the tables go."""

    scoring: ScoringJob
    thresholds: Thresholds

    @property
    def out(self) -> Path:
        """Folder of the tables."""
        return self.scoring.out


def curate(job: CurationJob, phases: Phases) -> list[Decision]:
    """Score, decide and write the tables.

    Raises:
        InputError: there is no clip.
        FileFormatError: a folder of shards is damaged as a whole.
        OutputError: the output folder cannot be written.
    """
    records = score_folders(job.scoring, phases)
    if not records:
        first = job.scoring.folders[0]
        raise InputError(f"{first}: expected clips, got none; import or prepare some")
    decisions = decide(records, job.thresholds)
    _write_tables(job, decisions)
    return decisions


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

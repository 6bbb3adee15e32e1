"""Rows of a report on a run over many clips, as CSV."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from diff4splat.io.atomic import write_text

_COLUMNS = ("sequence", "clip", "status", "error", "message")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportRow:
    """What became of one clip, or of a sequence that gave none."""

    sequence: str
    clip: str = ""
    status: str
    """``written``, ``present`` or ``failed``."""
    error: str = ""
    """Name of the error, such as ``FileFormatError``."""
    message: str = ""


def failed_row(sequence: str, clip: str, error: Exception) -> ReportRow:
    """The row of a clip that could not be used."""
    return ReportRow(
        sequence=sequence,
        clip=clip,
        status="failed",
        error=type(error).__name__,
        message=" ".join(str(error).split()),
    )


def write_rows(rows: Sequence[ReportRow], file: Path) -> None:
    """Write the table whole or not at all."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows([getattr(row, name) for name in _COLUMNS] for row in rows)
    write_text(file, text.getvalue())

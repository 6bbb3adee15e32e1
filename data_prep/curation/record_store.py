"""Records of a run on the disk: one line of JSON each, appended as soon as a clip is scored.

A run that is killed loses the clips that were being scored then; a torn last line is ignored. The
finished table is written anew, sorted, so that equal runs end in equal bytes.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.json_fields import dumps
from diff4splat.data_prep.curation.clip_record import ClipRecord, record_from_json, record_to_json
from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.output_error import output_error

FILE_NAME = "scores.jsonl"


@dataclass(frozen=True, slots=True)
class RecordStore:
    """``scores.jsonl`` of a folder."""

    folder: Path

    @property
    def file(self) -> Path:
        """Where the lines are."""
        return self.folder / FILE_NAME

    def read(self) -> dict[tuple[str, str], ClipRecord]:
        """Every record that is whole; of several of one clip the last."""
        try:
            lines = self.file.read_text(encoding="utf-8", errors="replace").splitlines()
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise output_error(self.file, error) from error
        records = [record for line in lines if (record := _record(line)) is not None]
        return {record.key: record for record in records}

    def append(self, record: ClipRecord) -> None:
        """Add a line, on the disk before this returns."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with self.file.open("ab+") as stream:
                if stream.tell() and not _ends_with_newline(stream):
                    stream.write(b"\n")
                stream.write(dumps(record_to_json(record)).encode())
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise output_error(self.file, error) from error

    def rewrite(self, records: list[ClipRecord]) -> None:
        """All records, sorted, whole or not at all."""
        ordered = sorted(records, key=lambda record: record.key)
        write_text(self.file, "".join(dumps(record_to_json(record)) for record in ordered))


def _ends_with_newline(stream) -> bool:
    stream.seek(-1, os.SEEK_END)
    return stream.read(1) == b"\n"


def _record(line: str) -> ClipRecord | None:
    """None for a torn or damaged line: its clip is scored again."""
    try:
        value = json.loads(line)
        return record_from_json(value) if isinstance(value, dict) else None
    except (ValueError, FileFormatError, RecursionError):
        return None

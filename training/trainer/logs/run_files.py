"""Names inside a stage's folder, and its log: one JSON object per line.

    log.jsonl  result.json  skipped.json  checkpoints/  panels/  tensorboard/

Rows are ``{"event": "step", "step": …}`` and so on. After a crash or a roll-back steps appear
twice; the later row counts. Numbers that are not finite are written as null.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diff4splat.errors import OutputError
from diff4splat.io.atomic import output_error
from diff4splat.io.require_file import require_writable

LOG_FILE = "log.jsonl"
RESULT_FILE = "result.json"
CHECKPOINTS = "checkpoints"
PANELS = "panels"
TENSORBOARD = "tensorboard"


class EventLog:
    """Appends rows; each is on disk when the call returns."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / LOG_FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._end_last_line()
        except OutputError:
            raise
        except OSError as error:
            raise output_error(self._file, error) from error

    def write(self, event: str, step: int, values: Mapping[str, Any]) -> None:
        """One row.

        Raises:
            OutputError: the disk is full.
        """
        row = json.dumps({"event": event, "step": step} | finite(values), allow_nan=False)
        try:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(row + "\n")
        except OSError as error:
            raise output_error(self._file, error) from error

    def _end_last_line(self) -> None:
        """A killed run may have left half a row, which must not swallow the next one."""
        require_writable(self._file)
        if self._file.is_file() and self._file.read_bytes()[-1:] not in (b"", b"\n"):
            with self._file.open("a", encoding="utf-8") as file:
                file.write("\n")


def finite(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same with null for NaN and infinity, which JSON does not know."""
    return {key: _finite(value) for key, value in values.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return finite(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value

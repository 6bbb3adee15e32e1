"""Rows of an interrupted report, so that a second call measures only the inputs that are left."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from diff4splat.evaluation.skipped.measurement import Measured
from diff4splat.io.atomic import write_text
from diff4splat.progress.machine import this_machine

PARTIAL = "skipped.partial.json"


class PartialRows:
    """Rows by input, in a file of the report's folder; for the same machine and options alone."""

    def __init__(self, folder: Path, options: Mapping[str, Any]) -> None:
        self.file = folder / PARTIAL
        self.key = {"machine": asdict(this_machine()), **options}
        self.rows = self._read()

    def once(self, source: str, measure: Callable[[], Sequence[Measured]]) -> list[Measured]:
        """Rows of one input, measured before or now."""
        if source not in self.rows:
            self.rows[source] = [asdict(row) for row in measure()]
            record = {"key": self.key, "rows": self.rows}
            write_text(self.file, json.dumps(record, indent=1) + "\n")
        return [Measured(**row) for row in self.rows[source]]

    def remove(self) -> None:
        """The report is complete."""
        self.file.unlink(missing_ok=True)

    def _read(self) -> dict[str, list[dict[str, Any]]]:
        try:
            record = json.loads(self.file.read_text())
            return dict(record["rows"]) if record["key"] == self.key else {}
        except (OSError, ValueError, KeyError, TypeError):
            # A damaged note of an earlier call is worth no more than none.
            return {}

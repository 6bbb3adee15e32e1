"""Rows of an interrupted report, so that a second run measures only what is left.

``error-time.partial.json`` lies in the folder of the report while it runs. Rows count for the same
machine, versions, inputs and repeats alone.
"""

import json
from collections.abc import Hashable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.io.atomic import write_text
from diff4splat.progress.machine import this_machine

PARTIAL = "error-time.partial.json"


class PartialReport:
    """The rows that a folder holds, and those that are added."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        self.file = folder / PARTIAL
        self.key = {"machine": asdict(this_machine()), **run}
        self.rows: dict[str, dict[str, Any]] = self._read()

    def known(self, knob: ApproximationSetting) -> dict[Hashable, Measurement]:
        """Rows of values that the knob still has."""
        stored = self.rows.get(knob.name, {})
        return {
            setting: Measurement(
                setting=setting,
                label=knob.label(setting),
                series=knob.series(setting),
                **stored[str(setting)],
            )
            for setting in knob.settings
            if _is_row(stored.get(str(setting)))
        }

    def add(self, result: SweepResult) -> None:
        """Keep all rows of one knob."""
        self.rows[result.knob.name] = {str(row.setting): _numbers(row) for row in result.rows}
        record = {"key": self.key, "rows": self.rows}
        write_text(self.file, json.dumps(record, indent=1, allow_nan=True) + "\n")

    def remove(self) -> None:
        """The report is complete."""
        self.file.unlink(missing_ok=True)

    def _read(self) -> dict[str, dict[str, Any]]:
        try:
            record = json.loads(self.file.read_text())
            rows = record["rows"] if record["key"] == self.key else {}
            return {str(name): dict(of_knob) for name, of_knob in rows.items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # A damaged note of an earlier run is worth no more than none.
            return {}


def _is_row(stored: Any) -> bool:
    return isinstance(stored, dict) and set(stored) == {
        "seconds",
        "median_s",
        "error",
        "more_errors",
        "peak_bytes",
    }


def _numbers(row: Measurement) -> dict[str, Any]:
    return {
        "seconds": row.seconds,
        "median_s": row.median_s,
        "error": row.error,
        "more_errors": dict(row.more_errors),
        "peak_bytes": row.peak_bytes,
    }

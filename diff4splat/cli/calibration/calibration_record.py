"""What a calibration has measured so far, so that a second call measures only what is left.

``calibration.parts`` lies beside the table while it is made: inputs, scenes that runs wrote, and
``measured.json``. It counts for the same version, machine and inputs alone.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from diff4splat import __version__
from diff4splat.io.atomic import write_text
from diff4splat.outputs.budgets.speed import machine_name
from diff4splat.outputs.budgets.table import FORMAT

MEASURED = "measured.json"


class CalibrationRecord:
    """Numbers by name, in a folder that also holds what they were measured on."""

    def __init__(self, folder: Path, inputs: Mapping[str, Any]) -> None:
        """Go on with the numbers of ``folder`` if they have the same ``inputs``; else start."""
        self.folder = folder
        self.key = {"format": FORMAT, "version": __version__, "machine": machine_name(), **inputs}
        self.numbers = self._read()
        if not self.numbers:
            shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)

    def once(self, name: str, measure: Callable[[], Any]) -> Any:
        """What was measured under ``name`` before, or now."""
        if name not in self.numbers:
            self.numbers[name] = measure()
            record = {"key": self.key, "numbers": self.numbers}
            write_text(self.folder / MEASURED, json.dumps(record, indent=1) + "\n")
        return self.numbers[name]

    def remove(self) -> None:
        """The table is written."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _read(self) -> dict[str, Any]:
        try:
            record = json.loads((self.folder / MEASURED).read_text())
            return dict(record["numbers"]) if record["key"] == self.key else {}
        except (OSError, ValueError, KeyError, TypeError):
            # A damaged note of an earlier call is worth no more than none.
            return {}

"""``diff4splat report stability``: run the checks, write one page and one JSON file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from diff4splat.error_time.tables import this_machine
from diff4splat.io.atomic import write_text
from diff4splat.progress.phases import Phases
from diff4splat.stability.check import Check, Record
from diff4splat.stability.page.page import stability_page
from diff4splat.stability.runner import run_checks
from diff4splat.stability.tables import to_json, to_markdown


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityReport:
    """What was measured, and the files that hold it."""

    records: tuple[Record, ...]
    files: tuple[Path, ...]

    @property
    def table(self) -> str:
        """Everything as Markdown."""
        return to_markdown(self.records)


def run(out: Path, checks: Sequence[Check], phases: Phases | None = None) -> StabilityReport:
    """Run ``checks`` and write ``stability.html`` and ``stability.json`` into ``out``.

    Raises:
        OutputError: ``out`` cannot be written.
    """
    records = run_checks(checks, Phases() if phases is None else phases)
    machine = this_machine()
    files = (out / "stability.html", out / "stability.json")
    write_text(files[0], stability_page(records, machine))
    write_text(files[1], to_json(records, machine))
    return StabilityReport(records=tuple(records), files=files)

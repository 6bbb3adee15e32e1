"""Error-against-time results as JSON for programs and Markdown for people.

Seconds in JSON, milliseconds in Markdown. An error that is not finite is ``null`` in JSON.
"""

import json
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from diff4splat import __version__
from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.io.atomic import write_text

FORMAT = "diff4splat error-time 1"
NOTE = "Seconds are of this machine and of one run; compare them only within this report."


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What the seconds depend on."""

    diff4splat: str
    torch: str
    python: str
    system: str
    cores: int
    threads: int
    """Threads that PyTorch computes with."""

    def __str__(self) -> str:
        return (
            f"diff4splat {self.diff4splat}, torch {self.torch}, Python {self.python}, "
            f"{self.system}, {self.cores} cores, {self.threads} thread(s)"
        )


def this_machine() -> Machine:
    """Versions and thread counts of this process."""
    return Machine(
        diff4splat=__version__,
        torch=torch.__version__,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        cores=os.cpu_count() or 1,
        threads=torch.get_num_threads(),
    )


def to_json(results: Sequence[SweepResult], machine: Machine) -> str:
    """Everything that was measured."""
    knobs = [_knob_record(result) for result in results]
    record = {"format": FORMAT, "machine": asdict(machine), "note": NOTE, "knobs": knobs}
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def to_markdown(results: Sequence[SweepResult], machine: Machine) -> str:
    """One table per knob, with the Pareto front marked."""
    head = ["# Error against run time", "", f"{machine}.", NOTE]
    return "\n".join([*head, *(line for result in results for line in _section(result))]) + "\n"


def write_tables(folder: Path, results: Sequence[SweepResult]) -> tuple[Path, Path]:
    """Write ``error-time.json`` and ``error-time.md`` into ``folder``.

    Raises:
        OutputError: the folder cannot be written.
    """
    machine = this_machine()
    as_json, as_markdown = folder / "error-time.json", folder / "error-time.md"
    write_text(as_json, to_json(results, machine))
    write_text(as_markdown, to_markdown(results, machine))
    return as_json, as_markdown


def _knob_record(result: SweepResult) -> dict[str, object]:
    knob, front = result.knob, result.pareto()
    return {
        "name": knob.name,
        "summary": knob.summary,
        "error_unit": knob.error_unit,
        "default": str(knob.default),
        "reference": str(knob.reference),
        "repeats": result.repeats,
        "rows": [_row_record(row, row in front) for row in result.rows],
    }


def _row_record(row: Measurement, on_front: bool) -> dict[str, object]:
    return {
        "setting": str(row.setting),
        "series": row.series,
        "label": row.label,
        "seconds": row.seconds,
        "median_s": row.median_s,
        "error": row.error if math.isfinite(row.error) else None,
        "pareto": on_front,
    }


def _section(result: SweepResult) -> list[str]:
    knob, front = result.knob, result.pareto()
    rows = [_table_line(row, row in front, row is result.default) for row in result.rows]
    return [
        *("", f"## {knob.name}", "", f"Approximates: {knob.summary}."),
        f"Reference: {knob.reference}. Fastest of {result.repeats} runs.",
        *("", f"| setting | ms | {knob.error_unit} | Pareto |", "| --- | ---: | ---: | :-: |"),
        *rows,
    ]


def _table_line(row: Measurement, on_front: bool, is_default: bool) -> str:
    name = f"**{row.setting}** (default)" if is_default else str(row.setting)
    error = f"{row.error:.2e}" if math.isfinite(row.error) else "not finite"
    return f"| {name} | {row.seconds * 1e3:.3g} | {error} | {'●' if on_front else ''} |"

"""Error-against-time results as JSON for programs and Markdown for people.

Seconds in JSON, milliseconds in Markdown. An error that is not finite is ``null`` in JSON.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.io.atomic import write_text
from diff4splat.progress.machine import Machine, this_machine

FORMAT = "diff4splat error-time 1"
NOTE = (
    "Seconds are of this machine and of one run, with one thread processor seconds; compare them "
    "only within this report."
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
        "fields": list(knob.fields),
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
        "more_errors": {name: _number(value) for name, value in row.more_errors.items()},
        "peak_bytes": row.peak_bytes,
        "pareto": on_front,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _section(result: SweepResult) -> list[str]:
    knob, front = result.knob, result.pareto()
    more = list(result.rows[0].more_errors)
    columns = ["setting", "ms", knob.error_unit, *more, "MB", "Pareto"]
    if all(row.peak_bytes is None for row in result.rows):
        columns.remove("MB")
    runs = f"Fastest of {result.repeats} runs" if result.repeats else "One run"
    return [
        *("", f"## {knob.name}", "", f"Approximates: {knob.summary}."),
        f"Reference: {knob.reference}. {runs}.",
        *("", f"| {' | '.join(columns)} |", f"| --- | {'---: | ' * (len(columns) - 2)}:-: |"),
        *(_table_line(row, row in front, row is result.default, columns) for row in result.rows),
    ]


def _table_line(row: Measurement, on_front: bool, is_default: bool, columns: Sequence[str]) -> str:
    name = f"**{row.name}** (default)" if is_default else row.name
    cells = [name, f"{row.seconds * 1e3:.3g}", _shown(row.error, ".2e")]
    cells += [_shown(value, ".3g") for value in row.more_errors.values()]
    if "MB" in columns:
        cells.append("" if row.peak_bytes is None else f"{row.peak_bytes / 1e6:.0f}")
    return f"| {' | '.join([*cells, '●' if on_front else ''])} |"


def _shown(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "not finite"

"""The report as JSON for programs and as Markdown for people.

An error that is not finite is ``null`` in JSON, and ``value_finite`` says why.
"""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from diff4splat.error_time.tables import Machine
from diff4splat.stability.check import VERDICTS, Record, Verdict
from diff4splat.stability.plots import Curves, HeatMap, Plot

FORMAT = "diff4splat stability 1"


def to_json(records: Sequence[Record], machine: Machine) -> str:
    """Every record, with the numbers of its plots."""
    record = {
        "format": FORMAT,
        "machine": asdict(machine),
        "verdicts": count_verdicts(records),
        "checks": [_check_record(each) for each in records],
    }
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def to_markdown(records: Sequence[Record]) -> str:
    """One line per check."""
    lines = [
        "| group | check | error | limit | value | gradient | s | verdict |",
        "|---|---|--:|--:|---|---|--:|---|",
    ]
    for record in records:
        check, outcome = record.check, record.outcome
        error = "" if outcome is None else error_text(outcome.error)
        limit = "" if math.isinf(check.limit) else f"{check.limit:g}"
        value = "" if outcome is None else finite_text(outcome.value_finite)
        gradient = "" if outcome is None else finite_text(outcome.gradient_finite)
        lines.append(
            f"| {check.group} | {check.name} | {error} | {limit} | {value} | {gradient} "
            f"| {record.seconds:.2f} | {record.verdict} |"
        )
    return "\n".join(lines) + "\n"


def count_verdicts(records: Sequence[Record]) -> dict[Verdict, int]:
    """How often each verdict was reached, 0 included."""
    counts = Counter(record.verdict for record in records)
    return {verdict: counts[verdict] for verdict in VERDICTS}


def error_text(error: float | None) -> str:
    """Two digits; empty without an error."""
    if error is None:
        return ""
    return f"{error:.1e}" if math.isfinite(error) else "not finite"


def finite_text(finite: bool | None) -> str:
    """Whether numbers are finite, in a word; a dash where there are none."""
    return {True: "finite", False: "not finite", None: "–"}[finite]


def _check_record(record: Record) -> dict[str, object]:
    check, outcome = record.check, record.outcome
    values: dict[str, object] = {
        "group": check.group,
        "name": check.name,
        "verdict": record.verdict,
        "seconds": round(record.seconds, 4),
        "error_unit": check.error_unit,
        "limit": _number(check.limit),
        "note": record.note,
    }
    if outcome is not None:
        plots = [_plot_record(plot) for plot in outcome.plots]
        values |= {
            "error": None if outcome.error is None else _number(outcome.error),
            "value_finite": outcome.value_finite,
            "gradient_finite": outcome.gradient_finite,
            "plots": [plot for plot in plots if plot],
        }
    return values


def _plot_record(plot: Plot) -> dict[str, object]:
    """Numbers; images are in the page alone."""
    if isinstance(plot, HeatMap):
        values = [[_number(value) for value in row] for row in plot.values]
        names = {
            "title": plot.title,
            plot.row_label: plot.rows,
            plot.column_label: plot.columns,
        }
        return names | {"values": values, "within_limit": plot.within_limit}
    if isinstance(plot, Curves):
        lines = {name: [_number(value) for value in y] for name, y in plot.lines}
        return {"title": plot.title, plot.x_label: plot.x, "lines": lines}
    return {}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None

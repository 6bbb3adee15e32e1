"""The page without any other file: numbers first, then pictures, tables folded away."""

import base64
import math
import re
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.evaluation.skipped.skipped_report import to_markdown
from diff4splat.reports.full_report import FullReport, Headline, headlines
from diff4splat.reports.groups import GROUPS, group_of
from diff4splat.stability.page.page import stability_overview, stability_sections, stability_style
from diff4splat.stability.page.svg import safe_text


def report_page(report: FullReport) -> str:
    """The page as text; everything that was measured is escaped."""
    tiles = "".join(_tile(one) for one in headlines(report))
    minutes = f"Measured in {report.seconds / 60:.1f} minutes on {report.machine}."
    parts = {
        "STYLE": stability_style() + "\n" + _asset("style.css"),
        "MACHINE": safe_text(minutes),
        "TILES": tiles,
        "KNOBS": "".join(_knob_group(name, report) for name in GROUPS),
        "SKIPPED": _skipped(report),
        "OVERVIEW": stability_overview(report.records),
        "STABILITY": stability_sections(report.records),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda part: parts[part[1]], _asset("report.html"))


def _tile(one: Headline) -> str:
    return (
        f'<div class="tile {"ok" if one.good else "refused"}"><b>{safe_text(one.number)}</b>'
        f"<span>{safe_text(one.what)}</span><small>{safe_text(one.detail)}</small></div>"
    )


def _knob_group(name: str, report: FullReport) -> str:
    pairs = [
        (result, plot)
        for result, plot in zip(report.knobs, report.plots, strict=True)
        if group_of(result.knob.name) == name
    ]
    if not pairs:
        return ""
    cards = "".join(_card(result, plot) for result, plot in pairs)
    return f'<h3>{safe_text(name)}</h3><div class="cards">{cards}</div>'


def _card(result: SweepResult, plot: Path) -> str:
    rows = "".join(_row(row, result) for row in result.rows)
    more = "".join(f"<th>{safe_text(name)}</th>" for name in result.rows[0].more_errors)
    return (
        f'<div class="card" id="{result.knob.name}"><img loading="lazy" alt="'
        f'{safe_text(result.knob.name)}" src="data:image/png;base64,{_picture(plot)}">'
        f"<details><summary>{safe_text(_summary(result))}</summary><table><thead><tr>"
        f"<th>setting</th><th>ms</th><th>{safe_text(result.knob.error_unit)}</th>{more}</tr></thead>"
        f"<tbody>{rows}</tbody></table></details></div>"
    )


def _summary(result: SweepResult) -> str:
    """The default in a line."""
    row = result.default
    error = "not finite" if math.isinf(row.error) else f"error {row.error:.2g}"
    return f"default {row.name}: {error}, {_duration(row.seconds)}"


def _row(row: Measurement, result: SweepResult) -> str:
    mark = "front" if row in result.pareto() else ""
    name = safe_text(row.name) + (" (default)" if row is result.default else "")
    numbers = [f"{row.seconds * 1e3:.3g}", _number(row.error, ".2e")]
    numbers += [_number(value, ".3g") for value in row.more_errors.values()]
    cells = "".join(f'<td class="number">{one}</td>' for one in numbers)
    return f'<tr class="{mark}"><td>{name}</td>{cells}</tr>'


def _skipped(report: FullReport) -> str:
    lines = to_markdown(report.skipped).splitlines()
    head, *rows = [_cells(line) for line in lines if not line.startswith("|---")]
    body = "".join(_table_row(row, "td") for row in rows)
    return (
        f'<img class="wide" alt="What runs leave out" src="data:image/png;base64,'
        f'{_picture(report.skipped_plot)}"><details><summary>Table</summary><table><thead>'
        f"{_table_row(head, 'th')}</thead><tbody>{body}</tbody></table></details>"
    )


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _table_row(cells: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{safe_text(cell)}</{tag}>" for cell in cells) + "</tr>"


def _picture(file: Path) -> str:
    return base64.b64encode(file.read_bytes()).decode("ascii")


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "not finite"


def _duration(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1 else f"{seconds * 1e3:.3g} ms"


def _asset(name: str) -> str:
    return (resources.files("diff4splat.reports") / "page" / name).read_text(encoding="utf-8")

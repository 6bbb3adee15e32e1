"""The report as one page without any other file: tiles, plots, one table per group."""

import base64
import io
import itertools
import math
import re
from collections.abc import Sequence
from importlib import resources

import numpy as np
import torch
from PIL import Image

from diff4splat.error_time.tables import Machine
from diff4splat.stability.check import VERDICTS, Outcome, Record
from diff4splat.stability.groups import GROUPS
from diff4splat.stability.page.svg import curves, error_bar, heat_map, safe_text
from diff4splat.stability.plots import Curves, HeatMap, Thumbnail
from diff4splat.stability.tables import count_verdicts, error_text

MAGENTA = (1.0, 0.0, 1.0)
THUMBNAIL_PX = 96
MEANINGS = {
    "ok": "finite, within the limit",
    "refused": "refused, with a message",
    "fails": "not finite, above the limit, or a crash",
    "not run": "something is not installed",
}


def stability_page(records: Sequence[Record], machine: Machine) -> str:
    """The page as text; everything that comes from records is escaped."""
    seconds = sum(record.seconds for record in records)
    parts = {
        "STYLE": stability_style(),
        "MACHINE": safe_text(f"{machine}. {len(records)} checks in {seconds:.0f} s."),
        "TILES": _tiles(records),
        "OVERVIEW": stability_overview(records),
        "SECTIONS": stability_sections(records),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda part: parts[part[1]], _asset("page.html"))


def stability_style() -> str:
    """Style sheet of the page and of its parts."""
    return _asset("style.css")


def stability_overview(records: Sequence[Record]) -> str:
    """One square per check, one row per group."""
    return _overview(_by_group(records))


def stability_sections(records: Sequence[Record]) -> str:
    """One section per group: plots and a table."""
    return "\n".join(_section(group, members) for group, members in _by_group(records))


def _by_group(records: Sequence[Record]) -> list[tuple[str, list[Record]]]:
    return [
        (group, list(members))
        for group, members in itertools.groupby(records, key=lambda record: record.check.group)
    ]


def _tiles(records: Sequence[Record]) -> str:
    counts = count_verdicts(records)
    return "".join(
        f'<div class="tile {_slug(verdict)}"><b>{counts[verdict]}</b><span>{verdict}</span>'
        f"<small>{MEANINGS[verdict]}</small></div>"
        for verdict in VERDICTS
        if counts[verdict] or verdict != "not run"
    )


def _overview(by_group: Sequence[tuple[str, list[Record]]]) -> str:
    """One square per check."""
    rows = []
    for group, members in by_group:
        squares = "".join(
            f'<i class="{_slug(record.verdict)}" title="{safe_text(record.check.name)}: '
            f'{record.verdict}"></i>'
            for record in members
        )
        rows.append(
            f'<a href="#{_slug(group)}">{safe_text(group)}</a><div class="squares">{squares}</div>'
        )
    return "".join(rows)


def _section(group: str, members: Sequence[Record]) -> str:
    about = GROUPS.get(group, "")
    plots = [plot for record in members if record.outcome for plot in record.outcome.plots]
    drawn = [_chart(plot) for plot in plots if not isinstance(plot, Thumbnail)]
    charts = f'<div class="charts">{"".join(drawn)}</div>' if drawn else ""
    rows = "\n".join(_row(record) for record in members)
    return (
        f'<section id="{_slug(group)}"><h2>{safe_text(group)}</h2><p>{safe_text(about)}</p>{charts}'
        "<table><thead><tr><th></th><th>check</th><th>error to float64</th><th></th>"
        "<th>value</th><th>gradient</th><th>s</th><th>note</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></section>"
    )


def _row(record: Record) -> str:
    check, outcome = record.check, record.outcome
    error = "" if outcome is None else error_text(outcome.error)
    bar = ""
    if outcome is not None and outcome.error is not None:
        bar = error_bar(outcome.error, check.limit)
    limit = "none" if math.isinf(check.limit) else f"{check.limit:g}"
    hint = safe_text(f"{check.error_unit}; limit {limit}")
    return (
        f'<tr class="{_slug(record.verdict)}"><td><span class="badge">{record.verdict}</span></td>'
        f'<td class="name">{safe_text(check.name)}{_thumbnails(outcome)}</td>'
        f'<td class="number" title="{hint}">{error}</td><td title="{hint}">{bar}</td>'
        f"<td>{_tick(outcome and outcome.value_finite)}</td>"
        f"<td>{_tick(outcome and outcome.gradient_finite)}</td>"
        f'<td class="number">{record.seconds:.2f}</td>'
        f'<td class="note">{safe_text(record.note)}</td></tr>'
    )


def _thumbnails(outcome: Outcome | None) -> str:
    images = [] if outcome is None else [p for p in outcome.plots if isinstance(p, Thumbnail)]
    if not images:
        return ""
    figures = "".join(
        f'<figure><img alt="{safe_text(image.caption)}" src="data:image/png;base64,{_png(image)}">'
        f"<figcaption>{safe_text(image.caption)}</figcaption></figure>"
        for image in images
    )
    return f'<div class="thumbnails">{figures}</div>'


def _png(image: Thumbnail) -> str:
    rgb = image.rgb.detach().float()
    lost = ~torch.isfinite(rgb).all(-1, keepdim=True)
    rgb = torch.where(lost, torch.tensor(MAGENTA), rgb).clamp(0, 1)
    picture = Image.fromarray((255 * rgb).round().byte().numpy().astype(np.uint8))
    picture.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX))
    stream = io.BytesIO()
    picture.save(stream, "png")
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _chart(plot: HeatMap | Curves) -> str:
    return heat_map(plot) if isinstance(plot, HeatMap) else curves(plot)


def _tick(finite: bool | None) -> str:
    if finite is None:
        return '<span class="none">–</span>'
    return '<span class="yes">✓</span>' if finite else '<span class="no">✗</span>'


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower())


def _asset(name: str) -> str:
    return (resources.files(__package__) / name).read_text(encoding="utf-8").rstrip()

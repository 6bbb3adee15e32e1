"""Heat maps, curves and error bars as SVG text. All text is escaped."""

import math
from html import escape
from itertools import pairwise

from diff4splat.progress.plain_text import plain_text
from diff4splat.stability.plots import Curves, HeatMap

CELL_PX, LABEL_PX = 22, 30
LOWEST, HIGHEST = -6.0, 0.0
"""Decades of the heat maps' colours."""
TITLE_CHARACTER_PX = 6
CURVE_SIZE = (420, 170)
LINE_COLORS = ("#2563eb", "#d97706", "#059669", "#9333ea")


def heat_map(plot: HeatMap) -> str:
    """One coloured cell per error, crossed out where it is not usable."""
    cells = CELL_PX * len(plot.columns)
    width = LABEL_PX + max(cells, TITLE_CHARACTER_PX * len(plot.title)) + 4
    height = 34 + CELL_PX * len(plot.rows) + 26
    parts = [_text(LABEL_PX, 12, plot.title, "title"), _text(0, 28, plot.row_label, "axis")]
    for row, (name, values) in enumerate(zip(plot.rows, plot.values, strict=True)):
        y = 34 + CELL_PX * row
        parts.append(_text(LABEL_PX - 5, y + 15, name, "tick end"))
        for column, value in enumerate(values):
            x = LABEL_PX + CELL_PX * column
            hint = (
                f"{plot.row_label} {name}, {plot.columns[column]} {plot.column_label}: {value:.1e}"
            )
            parts.append(_cell(x, y, value, hint, plot.within_limit[row][column]))
    bottom = 34 + CELL_PX * len(plot.rows)
    for column, name in enumerate(plot.columns):
        parts.append(_text(LABEL_PX + CELL_PX * (column + 0.5), bottom + 12, name, "tick middle"))
    parts.append(_text(LABEL_PX, bottom + 24, plot.column_label, "axis"))
    return _svg(width, height, parts, plot.title)


def curves(plot: Curves) -> str:
    """Lines over a common axis; zeros and numbers that are not finite leave gaps."""
    width, height = CURVE_SIZE
    shown = [y for _, line in plot.lines for y in line if 0 < y < math.inf]
    low, high = (math.log10(f(shown)) for f in (min, max)) if shown else (-1.0, 0.0)
    low, high = math.floor(low), max(math.ceil(high), math.floor(low) + 1)
    left, top, right, bottom = 52, 22, width - 8, height - 30

    def place(x: float, y: float) -> tuple[float, float]:
        across = (x - plot.x[0]) / max(plot.x[-1] - plot.x[0], 1e-9)
        up = (math.log10(y) - low) / (high - low)
        return left + across * (right - left), bottom - up * (bottom - top)

    parts = [_text(left, 12, plot.title, "title")]
    for decade in range(low, high + 1):
        y = place(plot.x[0], 10.0**decade)[1]
        parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}" class="grid"/>')
        parts.append(_text(left - 5, y + 4, f"1e{decade}", "tick end"))
    for color, (name, line) in zip(LINE_COLORS, plot.lines, strict=False):
        points = [place(x, y) for x, y in zip(plot.x, line, strict=True) if 0 < y < math.inf]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="1.5"/>')
        if points:
            x, y = points[-1]
            parts.append(_text(x - 4, y - 5, name, "tick end", color))
    parts.append(_text(left, height - 14, f"{plot.x[0]:g}", "tick"))
    parts.append(_text(right, height - 14, f"{plot.x[-1]:g}", "tick end"))
    parts.append(_text((left + right) / 2, height - 3, plot.x_label, "tick middle"))
    return _svg(width, height, parts, plot.title)


def error_bar(error: float, limit: float) -> str:
    """A bar from 1e-16 to 10 on a logarithmic axis, with the limit as a line."""
    width, height = 150, 14
    length = width * _share(error)
    kind = "over" if not error <= limit else "under"
    mark = ""
    if math.isfinite(limit) and limit > 0:
        x = width * _share(limit)
        mark = f'<line x1="{x:.1f}" y1="0" x2="{x:.1f}" y2="{height}" class="limit"/>'
    bar = f'<rect y="3" width="{length:.1f}" height="8" rx="2" class="bar {kind}"/>'
    track = f'<rect y="3" width="{width}" height="8" rx="2" class="track"/>'
    return _svg(width, height, [track, bar, mark], "error")


def safe_text(text: str) -> str:
    """Text for elements and attributes, without markup and control characters."""
    return escape(plain_text(text), quote=True)


def heat_color(value: float) -> str:
    """From pale green (1e-6 and below) over yellow to dark red (1 and above)."""
    if not math.isfinite(value):
        return "#111827"
    stops = (
        (0, (209, 250, 229)),
        (0.5, (253, 230, 138)),
        (0.8, (249, 115, 22)),
        (1, (153, 27, 27)),
    )
    share = 0.0 if value <= 0 else (math.log10(value) - LOWEST) / (HIGHEST - LOWEST)
    share = min(max(share, 0.0), 1.0)
    for (start, first), (stop, last) in pairwise(stops):
        if share <= stop:
            weight = (share - start) / (stop - start)
            mixed = (round(a + weight * (b - a)) for a, b in zip(first, last, strict=True))
            return "#" + "".join(f"{channel:02x}" for channel in mixed)
    return "#991b1b"


def _share(value: float) -> float:
    if not math.isfinite(value):
        return 1.0
    return 0.0 if value <= 0 else min(max((math.log10(value) + 16) / 17, 0.0), 1.0)


def _cell(x: int, y: int, value: float, hint: str, usable: bool) -> str:
    side = CELL_PX - 2
    square = (
        f'<rect x="{x}" y="{y}" width="{side}" height="{side}" rx="3" fill="{heat_color(value)}">'
        f"<title>{safe_text(hint)}</title></rect>"
    )
    if usable:
        return square
    a, b, c, d = x + 6, y + 6, x + side - 6, y + side - 6
    return square + f'<path d="M{a} {b}L{c} {d}M{a} {d}L{c} {b}" class="cross"/>'


def _text(x: float | int, y: float | int, text: str, kind: str, color: str = "") -> str:
    fill = f' style="fill:{color}"' if color else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}"{fill}>{safe_text(text)}</text>'


def _svg(width: int, height: int, parts: list[str], label: str) -> str:
    return (
        f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{safe_text(label)}">{"".join(parts)}</svg>'
    )

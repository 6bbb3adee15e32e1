"""Differences to the full variant as horizontal bars with their intervals.

The only file here that imports matplotlib, and only inside functions; without pyplot.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ablations.results import Row, difference
from diff4splat.evaluation.columns import column_of
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.io.atomic import atomic_path
from diff4splat.io.figures.plots import DPI

SHOWN = ("covisible_psnr", "track_error")
BETTER, WORSE, INTERVAL = "#56b4e9", "#d55e00", "#222222"
"""Of Okabe and Ito: told apart with any colour vision."""


def draw_differences(rows: Sequence[Row], protocol: Protocol, file: Path) -> None:
    """One panel per measure, one bar per variant; the first row is what all are held against."""
    from matplotlib.figure import Figure

    full, others = rows[0], [row for row in rows[1:] if row.name]
    figure = Figure(figsize=(10.0, 1.4 + 0.38 * len(others)), dpi=DPI, layout="constrained")
    panels = figure.subplots(1, len(SHOWN), sharey=True)
    for panel, key in zip(panels, SHOWN, strict=True):
        for place, row in enumerate(others):
            _bar(panel, place, difference(row, full, key, protocol), column_of(key).sign)
        _label(panel, key)
    panels[0].set_yticks(range(len(others)), [row.title for row in others])
    panels[0].invert_yaxis()
    count = max(len(row.items) for row in rows)
    figure.suptitle(f"Variant minus full, {count} clips, {protocol.name}", fontsize=11)
    with atomic_path(file) as temporary:
        figure.savefig(temporary)


def _bar(panel: Any, place: int, found: Any, sign: int) -> None:
    """A mean and its interval; a variant without a value keeps its place empty."""
    value = 0.0 if found is None else found.value
    panel.barh(place, value, height=0.62, color=BETTER if sign * value > 0 else WORSE)
    if found is not None and found.low is not None:
        panel.plot([found.low, found.high], [place, place], color=INTERVAL, linewidth=1.4)
        panel.plot([found.low, found.high], [place, place], "|", color=INTERVAL, markersize=7)


def _label(panel: Any, key: str) -> None:
    column = column_of(key)
    better, worse = ("right", "left") if column.sign > 0 else ("left", "right")
    panel.set_xlabel(f"{column.title}: {better} is better, {worse} is worse", fontsize=9)
    panel.axvline(0, color="0.3", linewidth=0.8)
    panel.grid(axis="x", color="0.9")
    panel.set_axisbelow(True)
    panel.tick_params(labelsize=9)

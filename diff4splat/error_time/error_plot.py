"""Draws error against run time on logarithmic axes: one curve per series and the Pareto front.

An error of 0 has no place on a logarithmic axis: it gets a line of its own at the bottom. Settings
whose result is not finite are named in a corner.
"""

import math
from pathlib import Path
from typing import Any

from diff4splat.error_time.sweep import Measurement, SweepResult
from diff4splat.io.figures.plots import label_log_axis, new_figure, save_figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito: distinct with any colour vision, and in grey with the markers."""
MARKERS = "osD^vPX*<>h"
"""More than colours: curves beyond the last colour begin anew with other markers, and dashed."""
LONG_LABEL = 50
"""Characters of the meaning of labels that still fit beside the name of the axis."""


def save_error_time_plot(result: SweepResult, file: Path) -> None:
    """Error against run time of one knob, with the Pareto front.

    Raises:
        MissingExtraError: matplotlib is not installed.
        OutputError: the file cannot be written.
    """
    figure = new_figure(6.4, 4.2)
    axes = figure.subplots()
    draw(axes, result)
    if axes.get_xscale() == "log":
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            label_log_axis(axis, high / low)
    save_figure(figure, file)


def draw(axes: Any, result: SweepResult) -> None:
    """Fill ``axes`` with everything that ``result`` holds."""
    canvas = _Canvas(axes, result)
    canvas.front()
    for number, series in enumerate(dict.fromkeys(row.series for row in result.rows)):
        canvas.curve(series, number)
    canvas.default()
    canvas.exact_line()
    canvas.lost_settings()
    canvas.frame()


class _Canvas:
    """Axes with the scales that turn a measurement into a point."""

    def __init__(self, axes: Any, result: SweepResult) -> None:
        self.axes, self.result = axes, result
        self.unit, self.factor = ("ms", 1e3) if _slowest(result) < 1 else ("s", 1.0)
        positive = [row.error for row in result.rows if 0 < row.error < math.inf]
        self.exact = 0.3 * min(positive) if positive else 1.0

    def points(self, rows: list[Measurement]) -> tuple[list[float], list[float]]:
        """Positions on both axes."""
        return [row.seconds * self.factor for row in rows], [
            row.error or self.exact for row in rows
        ]

    def front(self) -> None:
        """A broad band behind the curves."""
        look = {"color": "0.82", "linewidth": 5, "solid_capstyle": "round", "zorder": 1}
        seconds, errors = self.points(list(self.result.pareto()))
        self.axes.plot(seconds, errors, drawstyle="steps-post", label="Pareto front", **look)

    def curve(self, series: str, number: int) -> None:
        """The points of one series with their labels."""
        color, marker = COLORS[number % len(COLORS)], MARKERS[number % len(MARKERS)]
        rows = [r for r in self.result.rows if r.series == series and math.isfinite(r.error)]
        seconds, errors = self.points(rows)
        # Only settings of a named series form a curve; others have no order to connect them in.
        look = {"color": color, "marker": marker, "markersize": 5, "linewidth": 1}
        line = ("-" if number < len(COLORS) else "--") if series else "none"
        self.axes.plot(seconds, errors, linestyle=line, label=series or None, **look)
        for row, x, y in zip(rows, seconds, errors, strict=True):
            place = {"xytext": (5, 4), "textcoords": "offset points"}
            self.axes.annotate(row.label, (x, y), fontsize=7, color=color, **place)

    def default(self) -> None:
        """A ring around the setting that commands use."""
        row = self.result.default
        if math.isfinite(row.error):
            ring = {"markersize": 12, "markerfacecolor": "none", "markeredgecolor": "0.2"}
            name = f"default: {row.name}"
            self.axes.plot(*self.points([row]), marker="o", linestyle="none", label=name, **ring)

    def exact_line(self) -> None:
        """Where errors of 0 are drawn."""
        if any(row.error == 0 for row in self.result.rows):
            self.axes.axhline(self.exact, color="0.5", linewidth=0.8, linestyle=":")
            place = {"xycoords": ("axes fraction", "data"), "va": "bottom"}
            self.axes.annotate("error 0", (0.01, self.exact), fontsize=7, color="0.3", **place)

    def lost_settings(self) -> None:
        """Name what has no place in the plot."""
        lost = [str(row.setting) for row in self.result.rows if not math.isfinite(row.error)]
        if lost:
            text = f"not finite: {', '.join(lost)}"
            self.axes.text(0.01, 0.99, text, transform=self.axes.transAxes, va="top", fontsize=7)

    def frame(self) -> None:
        """Scales, names and legend."""
        knob = self.result.knob
        between = "\n" if len(knob.label_meaning) > LONG_LABEL else "   "
        meaning = f"{between}(at the points: {knob.label_meaning})" if knob.label_meaning else ""
        if any(math.isfinite(row.error) for row in self.result.rows):
            self.axes.set(xscale="log", yscale="log")
        self.axes.set_ylabel(knob.error_unit)
        self.axes.set_xlabel(f"run time [{self.unit}]{meaning}")
        self.axes.set_title(f"{knob.name}: {knob.summary}", fontsize=9)
        self.axes.grid(True, which="major", color="0.92", linewidth=0.8)
        self.axes.set_axisbelow(True)
        self.axes.spines[["top", "right"]].set_visible(False)
        self.axes.margins(x=0.12, y=0.1)
        self.axes.legend(fontsize=7, frameon=False)


def _slowest(result: SweepResult) -> float:
    return max(row.seconds for row in result.rows)

"""Time against Gaussians, pixels, threads and blended pairs, log–log, one line per renderer.

The only file of the harness that imports matplotlib, and only inside functions; without pyplot.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from records import KINDS, Cell, Kind
from scenes import SCENES
from timing.scaling import Point

from diff4splat.io.atomic import atomic_path
from diff4splat.io.figures.plots import DPI, require_matplotlib
from report.tables import OURS

Series = dict[str, list[Cell]]
_TITLES: dict[Kind, str] = {"forward": "forward", "both": "forward + backward"}
_MARKS = "osD^vPX*<>"


def draw_all(cells: Sequence[Cell], folder: Path) -> list[Path]:
    """Every figure that has at least two points along its axis; the files written."""
    most = max((cell.threads for cell in cells), default=1)
    clouds = [cell for cell in cells if cell.scene.startswith("cloud-")]
    full = [cell for cell in clouds if cell.threads == most]
    size = _commonest(full, lambda cell: SCENES[cell.scene].size_px)
    count = _commonest(full, lambda cell: SCENES[cell.scene].count)
    # Of scenes that were run equally often the largest: it has most to gain from threads.
    by_size = sorted(cells, key=lambda cell: -SCENES[cell.scene].count)
    scene = _commonest(by_size, lambda cell: cell.scene)
    plans = [
        (
            "time-gaussians.png",
            "Gaussians" if size is None else f"Gaussians, picture {size[1]}×{size[0]}",
            [cell for cell in full if SCENES[cell.scene].size_px == size],
            lambda cell: SCENES[cell.scene].count,
        ),
        (
            "time-pixels.png",
            "pixels" if count is None else f"pixels, {count:,} Gaussians",
            [cell for cell in full if SCENES[cell.scene].count == count],
            _pixels,
        ),
        (
            "time-threads.png",
            f"threads, {scene}",
            [cell for cell in cells if cell.scene == scene],
            lambda cell: cell.threads,
        ),
    ]
    files = []
    for name, label, chosen, along in plans:
        if len({along(cell) for cell in chosen}) > 1:
            files.append(folder / name)
            draw(chosen, along, label, files[-1])
    return files


def draw(cells: Sequence[Cell], along: Callable[[Cell], float], label: str, file: Path) -> None:
    """One figure: forward on the left, forward + backward on the right."""
    figure = _figure(9.0, 4.2)
    panels = figure.subplots(1, 2, sharey=True)
    names = list(dict.fromkeys(cell.peer for cell in cells))
    for panel, kind in zip(panels, KINDS, strict=True):
        for number, name in enumerate(names):
            own = sorted((cell for cell in cells if cell.peer == name), key=along)
            points = [(along(cell), cell.timing(kind)) for cell in own]
            kept = [(at, 1e3 * timing.best_s) for at, timing in points if timing is not None]
            if kept:
                _line(panel, kept, name, number)
        _log_axes(panel, sorted({along(cell) for cell in cells}), label)
        panel.set_title(_TITLES[kind], fontsize=10)
    _whole_decades(panels[0])
    panels[0].set_ylabel("milliseconds")
    _legend(figure, panels)
    _save(figure, file)


def draw_slope(points: Sequence[Point], slopes: dict[str, float], file: Path) -> None:
    """Time against blended pairs, with a line of slope 1 to hold against."""
    figure = _figure(9.0, 4.2)
    panels = figure.subplots(1, 2, sharey=True)
    for panel, kind in zip(panels, KINDS, strict=True):
        drawn = [point for point in points if f"{point.series} {kind}" in slopes]
        for number, series in enumerate(dict.fromkeys(point.series for point in drawn)):
            own = [point for point in points if point.series == series]
            kept = [(p.pairs, 1e3 * s) for p in own if (s := p.seconds(kind)) is not None]
            slope = slopes.get(f"{series} {kind}")
            name = series if slope is None else f"{series}, slope {slope:.2f}"
            if kept:
                _line(panel, kept, name, number)
        _straight(panel)
        _log_axes(panel, None, "blended pairs of pixel and Gaussian")
        panel.set_title(_TITLES[kind], fontsize=10)
        if panel.lines:
            panel.legend(fontsize=8, frameon=False, loc="upper left")
    panels[0].set_ylabel("milliseconds")
    _save(figure, file)


def _line(panel: Any, points: Sequence[tuple[float, float]], name: str, number: int) -> None:
    ours = name in OURS
    panel.plot(
        *zip(*points, strict=True),
        label=name,
        color=f"C{number}",
        marker=_MARKS[number % len(_MARKS)],
        markersize=5,
        linewidth=2.2 if ours else 1.2,
    )


def _straight(panel: Any) -> None:
    """Proportional to pairs, through the last point of the first line."""
    if panel.lines:
        x, y = panel.lines[0].get_data()
        ends = [min(x), max(x)]
        through = [y[-1] * end / x[-1] for end in ends]
        panel.plot(ends, through, color="0.6", linestyle=":", label="proportional")


def _log_axes(panel: Any, ticks: Sequence[float] | None, label: str) -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel(label)
    panel.grid(which="major", color="0.9")
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())
    if ticks is not None:
        panel.set_xticks(ticks, [short(tick) for tick in ticks])
        panel.xaxis.set_minor_locator(NullLocator())


def _whole_decades(panel: Any) -> None:
    """Room for two labels at least, however little the times differ."""
    low, high = panel.get_ylim()
    panel.set_ylim(10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high)))


def short(value: float) -> str:
    """``100000`` as ``100k``."""
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:g}"


def _legend(figure: Any, panels: Sequence[Any]) -> None:
    """One legend for both panels; a renderer may have no backward."""
    found = {}
    for panel in panels:
        handles, names = panel.get_legend_handles_labels()
        found |= dict(zip(names, handles, strict=True))
    figure.legend(found.values(), found.keys(), loc="outside right center", fontsize=8)


def _commonest(cells: Sequence[Cell], key: Callable[[Cell], Any]) -> Any:
    """The value of ``key`` shared by most different (scene, threads); None without cells."""
    runs = {(cell.scene, cell.threads): key(cell) for cell in cells}
    values = list(runs.values())
    return max(values, key=values.count, default=None)


def _pixels(cell: Cell) -> int:
    height, width = SCENES[cell.scene].size_px
    return height * width


def _figure(width_in: float, height_in: float) -> Any:
    require_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def _save(figure: Any, file: Path) -> None:
    with atomic_path(file) as temporary:
        figure.savefig(temporary)

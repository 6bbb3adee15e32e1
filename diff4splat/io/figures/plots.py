"""Figures for people, drawn by matplotlib.

The only file that imports matplotlib, and only inside functions. Figures are made without pyplot,
so that nothing global changes and no window system is needed.
"""

from pathlib import Path
from typing import Any

from diff4splat.errors import MissingExtraError
from diff4splat.io.atomic import atomic_path

DPI = 160


def require_matplotlib() -> None:
    """Say how to install matplotlib before work is spent on something to draw.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import matplotlib.figure
    except ImportError as error:
        raise MissingExtraError(
            "plot: expected matplotlib, got none installed; pip install 'diff4splat[plot]'"
        ) from error
    del matplotlib


def new_figure(width_in: float, height_in: float) -> Any:
    """An empty figure of this size in inches.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def save_figure(figure: Any, file: Path) -> None:
    """Write a figure; the suffix decides the format.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_path(file) as temporary:
        figure.savefig(temporary)


def label_log_axis(axis: Any, span: float) -> None:
    """Plain numbers, about five of them: matplotlib's own powers of ten overlap on short spans."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    if span < 4:
        axis.set_major_locator(MaxNLocator(5))
    elif span < 200:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())

"""Pictures for reports: error against run time, and what a camera path looks like.

The only file that imports matplotlib, and only inside functions. Figures are made without pyplot,
so that nothing global changes and no window system is needed.
"""

from pathlib import Path
from typing import Any

from diff4splat.errors import MissingExtraError
from diff4splat.io.atomic import atomic_path
from diff4splat.paths.camera_path import CameraPath, require_usable
from diff4splat.report import error_picture, path_picture
from diff4splat.report.sweep import SweepResult

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


def save_error_time_plot(result: SweepResult, file: Path) -> None:
    """Error against run time of one knob, with the Pareto front.

    Raises:
        MissingExtraError: matplotlib is not installed.
        OutputError: the file cannot be written.
    """
    figure = _figure(6.4, 4.2)
    axes = figure.subplots()
    error_picture.draw(axes, result)
    if axes.get_xscale() == "log":
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            _label_log_axis(axis, high / low)
    _save(figure, file)


def save_path_preview(path: CameraPath, file: Path, title: str) -> None:
    """The path from above, from the side and from the front, with speed and turning.

    Raises:
        InputError: the path cannot be followed.
        MissingExtraError: matplotlib is not installed.
        OutputError: the file cannot be written.
    """
    require_usable(path, "camera path")
    figure = _figure(7.6, 6.4)
    path_picture.draw(figure, path, title)
    _save(figure, file)


def _figure(width_in: float, height_in: float) -> Any:
    require_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def _label_log_axis(axis: Any, span: float) -> None:
    """Plain numbers, about five of them: matplotlib's own powers of ten overlap on short spans."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    if span < 4:
        axis.set_major_locator(MaxNLocator(5))
    elif span < 200:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _save(figure: Any, file: Path) -> None:
    with atomic_path(file) as temporary:
        figure.savefig(temporary)

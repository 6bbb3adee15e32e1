"""How our cost grows with the work: time against blended pairs, over three decades.

Three series: ``picture`` enlarges an image of 128² to 4096² with its Gaussians, 0.38 per pixel, as
in the cloud of 100,000 at 512². At 512² ``count`` adds Gaussians of one size and ``footprint``
enlarges a fixed number of them, with opacities of 0.01 to 0.03, so that light never runs out. The
slope is the least-squares fit of log time over log pairs; 1 is proportional. An image of one
Gaussian tells what 512² cost whatever is in it; the second slope is that of the time beyond it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from records import KINDS, Cell, Kind
from scenes import Look, Scene, cloud

from timing.interleaved import Subject

_SIZE_PX, _OPACITY = (512, 512), (0.01, 0.03)
EDGES_PX, PER_PIXEL = (128, 256, 512, 1024, 2048, 4096), 100_000 / 512**2
COUNTS = (1_000, 3_200, 10_000, 32_000, 100_000, 320_000, 1_000_000)
RADII_PX = (6.0, 11.0, 19.0, 34.0, 60.0, 107.0, 190.0)
_FIXED_RADIUS_PX, _FIXED_COUNT = 10.0, 3_000
FIXED = "one Gaussian"
"""The series of a single scene whose time is that of the image itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One scene of a series."""

    series: str
    pairs: float
    gaussians: int
    forward_s: float | None
    both_s: float | None

    def seconds(self, kind: Kind) -> float | None:
        """Best window of one kind of call."""
        return self.forward_s if kind == "forward" else self.both_s


def _scene(name: str, count: int, radius_px: float) -> Scene:
    look = Look(radius_px=(radius_px, radius_px), opacity=_OPACITY)
    return Scene(name=name, count=count, size_px=_SIZE_PX, make=partial(cloud, look))


def _picture(edge_px: int) -> Scene:
    count = round(PER_PIXEL * edge_px**2)
    return Scene(
        name=f"picture-{edge_px}",
        count=count,
        size_px=(edge_px, edge_px),
        make=partial(cloud, Look()),
    )


SERIES = (
    *(("picture", _picture(edge_px)) for edge_px in EDGES_PX),
    (FIXED, _scene("one", 1, _FIXED_RADIUS_PX)),
    *(("count", _scene(f"count-{count}", count, _FIXED_RADIUS_PX)) for count in COUNTS),
    *(("footprint", _scene(f"footprint-{r:g}px", _FIXED_COUNT, r)) for r in RADII_PX),
)
"""(series, scene), fewest pairs first."""


def point(name: str, subject: Subject, cell: Cell) -> Point:
    """One measured scene of a series."""
    return Point(
        series=name,
        pairs=subject.work.blended_pairs,
        gaussians=subject.work.gaussians,
        forward_s=None if cell.forward is None else cell.forward.best_s,
        both_s=None if cell.both is None else cell.both.best_s,
    )


def fit(pairs: Sequence[float], seconds: Sequence[float]) -> float:
    """The least-squares slope of log seconds over log pairs; NaN with fewer than two points."""
    if len(pairs) < 2:
        return math.nan
    x, y = [math.log(value) for value in pairs], [math.log(value) for value in seconds]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    spread = sum((value - mean_x) ** 2 for value in x)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / spread


def slopes(points: Sequence[Point], beyond_fixed: bool = False) -> dict[str, float]:
    """The slope of every series and kind, of all time or of that beyond the image's own."""
    found = {}
    for kind in KINDS:
        for name in dict.fromkeys(point.series for point in points if point.series != FIXED):
            # Images of other sizes cost something else.
            fixed = _fixed_s(points, kind) if beyond_fixed and name != "picture" else 0.0
            kept = [
                (point.pairs, seconds - fixed)
                for point in points
                if point.series == name
                and (seconds := point.seconds(kind)) is not None
                and seconds > fixed
            ]
            found[f"{name} {kind}"] = fit(*zip(*kept, strict=True)) if kept else math.nan
    return found


def _fixed_s(points: Sequence[Point], kind: Kind) -> float:
    """Seconds of an image of one Gaussian; 0 where that was not measured."""
    return next((p.seconds(kind) or 0.0 for p in points if p.series == FIXED), 0.0)


def to_markdown(points: Sequence[Point], peer: str) -> str:
    """The points and the slopes."""
    lines = [f"# Cost of {peer} against blended pairs", ""]
    lines += ["| series | Gaussians | blended pairs | forward ms | fwd + bwd ms |"]
    lines += ["| --- | ---: | ---: | ---: | ---: |"]
    for point in points:
        times = [
            "–" if (seconds := point.seconds(kind)) is None else f"{1e3 * seconds:.2f}"
            for kind in KINDS
        ]
        lines.append(
            f"| {point.series} | {point.gaussians:,} | {point.pairs:.2e} | {' | '.join(times)} |"
        )
    beyond = slopes(points, beyond_fixed=True)
    lines += [
        "",
        "Slope of all time, and of the time beyond that of a picture of one Gaussian:",
        "",
    ]
    lines += [
        f"- {name}: {value:.2f}, {beyond[name]:.2f}" for name, value in slopes(points).items()
    ]
    return "\n".join(lines) + "\n"

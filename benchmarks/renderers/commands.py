"""The three things that the command does: list, compare, and find the slope."""

import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from loading import Peer, find_peers
from options import Options
from records import Cell, Work, plain
from report.plots import draw_all, draw_slope
from report.tables import OURS, Results, to_markdown
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from scenes import SCENES, choose
from timing.interleaved import Effort, Say, find_subject, measure
from timing.limits import LimitsWorker, MachineLimits
from timing.machine import this_machine
from timing.scaling import SERIES, point, slopes
from timing.scaling import to_markdown as slope_to_markdown
from workers.process import Worker, WorkerFailure

from diff4splat.errors import ConfigError
from diff4splat.io.atomic import write_text
from diff4splat.io.figures.plots import require_matplotlib

FORMAT = "diff4splat renderers 1"
Advance = Callable[[], None]


def list_all(options: Options) -> str:
    """Scenes and renderers, and why some cannot run."""
    lines = ["Scenes:"]
    for scene in SCENES.values():
        height, width = scene.size_px
        lines.append(f"  {scene.name:<20} {scene.count:>9,} Gaussians  {width}×{height}")
    lines.append("Renderers:")
    for peer in find_peers(options.plugins, ()):
        lines.append(f"  {peer.name:<20} {peer.unavailable or 'ready'}")
    return "\n".join(lines) + "\n"


def compare(options: Options) -> str:
    """Measure everything asked for; the report, which is also written with the rest."""
    scenes, peers = choose(options.scenes), find_peers(options.plugins, options.peers)
    effort, works, cells = options.effort(), list[Work](), list[Cell]()
    _require_drawing(options)
    with _scratch() as folder, _progress(1 + len(scenes)) as (say, advance):
        say("limits of the machine")
        limits = _limits(options.threads, effort)
        advance()
        for scene in scenes:
            say(f"{scene.name}: truth")
            subject = find_subject(scene, folder, effort)
            works.append(subject.work)
            for threads in options.threads:
                cells += measure(subject, peers, threads, effort, say)
            advance()
    results = Results(
        machine=this_machine(),
        limits=tuple(limits),
        works=tuple(works),
        cells=tuple(cells),
    )
    report = to_markdown(results)
    if options.out is not None:
        record = {"format": FORMAT, "effort": plain(effort), **plain(results)}
        write_text(options.out / "results.json", json.dumps(record, indent=1, allow_nan=False))
        write_text(options.out / "table.md", report)
        draw_all(cells, options.out)
    return report


def find_slope(options: Options) -> str:
    """Our renderer's time against blended pairs; the report, which is also written."""
    peer, effort = _ours(options), options.effort(checks=False)
    how = options.threads[0], effort
    _require_drawing(options)
    with _scratch() as folder, _progress(len(SERIES)) as (say, advance):
        points = []
        for name, scene in SERIES:
            say(f"{scene.name}: pairs")
            subject = find_subject(scene, folder, effort)
            points.append(point(name, subject, measure(subject, [peer], *how, say)[0]))
            advance()
    report = slope_to_markdown(points, peer.name)
    if options.out is not None:
        record = {"format": FORMAT, "peer": peer.name, "machine": plain(this_machine())}
        record |= {"points": plain(points), "slopes": plain(slopes(points))}
        record["slopes beyond one Gaussian"] = plain(slopes(points, beyond_fixed=True))
        write_text(options.out / "slope.json", json.dumps(record, indent=1, allow_nan=False))
        write_text(options.out / "slope.md", report)
        draw_slope(points, slopes(points, beyond_fixed=True), options.out / "slope.png")
    return report


def _ours(options: Options) -> Peer:
    """The first renderer asked for that can run; otherwise the first of ours."""
    ready = {
        peer.name: peer
        for peer in find_peers(options.plugins, options.peers)
        if peer.unavailable is None
    }
    wanted = next((name for name in options.peers or OURS if name in ready), None)
    if wanted is None:
        raise ConfigError("--peers: expected one renderer that can run here, got none")
    return ready[wanted]


def _limits(threads: Sequence[int], effort: Effort) -> list[MachineLimits]:
    """One per number of threads; a machine that will not say is left out."""
    found = []
    for count in threads:
        with suppress(WorkerFailure), Worker(LimitsWorker, effort.limits(count)) as desk:
            found.append(desk.ask("measure"))
    return found


def _require_drawing(options: Options) -> None:
    """Missing matplotlib is said before the work, not after it."""
    if options.out is not None:
        require_matplotlib()


@contextmanager
def _scratch() -> Iterator[Path]:
    """Where the truth lies while it is needed."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@contextmanager
def _progress(steps: int) -> Iterator[tuple[Say, Advance]]:
    """One bar on the error stream, and what is being measured."""
    columns = (
        *(BarColumn(bar_width=28), MofNCompleteColumn(), TimeElapsedColumn()),
        TextColumn("{task.description}", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True, highlight=False)) as bars:
        task = bars.add_task("", total=steps)
        yield (
            lambda words: bars.update(task, description=words),
            lambda: bars.advance(task),
        )

"""Results as Markdown tables for people, one per scene and number of threads.

Milliseconds are those of the best window; a ratio is against the first of ours that was measured.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass

from ground_truth.comparison import verdict, worst_gradient
from records import Cell, Kind, Timing, Work
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table
from rich.text import Text
from timing.limits import MachineLimits, Shares, shares
from timing.machine import Description

OURS = ("raster", "reference")
LEGEND = (
    "ms: best window; ×: against our own renderer in the same rounds; MiB: growth of resident "
    "memory above the prepared scene. dB, wrong, bias: picture against float64 brute force at the "
    "sampled pixels (wrong: off by more than half a level of 255; doubtful: an alpha within 0.1 % "
    "of the cutoff). gradient: relative L2 error of the worst parameter, and which."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Everything one run measured."""

    machine: Description
    limits: tuple[MachineLimits, ...]
    works: tuple[Work, ...]
    cells: tuple[Cell, ...]

    def work(self, scene: str) -> Work | None:
        """The work in one scene."""
        return next((work for work in self.works if work.scene == scene), None)

    def groups(self) -> list[tuple[str, int]]:
        """(scene, threads) in the order they were measured."""
        return list(dict.fromkeys((cell.scene, cell.threads) for cell in self.cells))

    def group(self, scene: str, threads: int) -> list[Cell]:
        """The cells of one table."""
        return [cell for cell in self.cells if (cell.scene, cell.threads) == (scene, threads)]


def baseline(cells: Sequence[Cell]) -> Cell | None:
    """Ours, the fast one first, if it was measured."""
    measured = {cell.peer: cell for cell in cells if cell.forward is not None}
    return next((measured[name] for name in OURS if name in measured), None)


def to_markdown(results: Results) -> str:
    """The whole report."""
    lines = ["# Renderers side by side", "", f"{results.machine}.", "", LEGEND]
    for scene, threads in results.groups():
        cells = results.group(scene, threads)
        lines += ["", f"## {scene}, {threads} thread(s)", "", *_work_line(results.work(scene))]
        lines += _others_line(cells)
        lines += ["", markdown_table(cells), ""]
        lines += [f"- {cell.peer}: {cell.note}" for cell in cells if cell.note]
    lines += ["", "## Against the limits of the machine", "", limits_table(results)]
    return "\n".join(lines) + "\n"


def _work_line(work: Work | None) -> list[str]:
    if work is None:
        return []
    checked = f" Not checked: {work.reason}." if work.reason else ""
    pairs = "unknown" if work.reason else f"{work.blended_pairs:.3g}"
    return [
        f"{work.gaussians:,} Gaussians, {work.pixels:,} pixels, {pairs} blended pairs.{checked}"
    ]


def _others_line(cells: Sequence[Cell]) -> list[str]:
    """Said only where it matters: milliseconds suffer, ratios hardly."""
    others = max(cell.others_cores for cell in cells)
    return [f"Other programs kept {others:.1f} cores busy meanwhile."] if others >= 0.1 else []


def markdown_table(cells: Sequence[Cell]) -> str:
    """One row per renderer."""
    base = baseline(cells)
    table = Table(box=MARKDOWN)
    for name in ("renderer", "forward ms", "×", "MiB", "fwd + bwd ms", "×", "MiB"):
        table.add_column(name, justify="left" if name == "renderer" else "right")
    for name in ("dB", "wrong / doubtful / of", "bias", "gradient", "verdict"):
        table.add_column(name, justify="right" if name in ("dB", "bias") else "left")
    for cell in cells:
        times = (*_times(cell, base, "forward"), *_times(cell, base, "both"))
        # Text, because a reason may hold what rich or Markdown would take for their own.
        table.add_row(cell.peer, *times, *map(_plain, _checks(cell)))
    return _text(table)


def limits_table(results: Results) -> str:
    """Our renderer on every scene, as nanoseconds per blended pair and shares of the limits."""
    table = Table(box=MARKDOWN)
    for name in ("scene", "threads", "renderer", "pass"):
        table.add_column(name)
    for name in ("ns / pair", "GFLOP/s", "of peak", "least traffic of copy"):
        table.add_column(name, justify="right")
    for scene, threads in results.groups():
        ours, work = baseline(results.group(scene, threads)), results.work(scene)
        limit = next((each for each in results.limits if each.threads == threads), None)
        if ours is None or work is None or limit is None:
            continue
        for backward, name in ((False, "forward"), (True, "fwd + bwd")):
            share = shares(ours, work, limit, backward)
            if share is not None:
                table.add_row(scene, str(threads), ours.peer, name, *_shares(share))
    heads = [
        f"{each.threads} thread(s): {each.flops / 1e9:.0f} GFLOP/s by {each.how}, "
        f"{each.bytes_per_s / 1e9:.0f} GB/s by copying."
        for each in results.limits
    ]
    return "\n".join([*heads, "", _text(table)])


def _shares(share: Shares) -> list[str]:
    return [
        f"{share.ns_per_pair:.2f}",
        f"{share.flops / 1e9:.1f}",
        f"{100 * share.flops_share:.1f} %",
        f"{100 * share.bytes_share:.1f} %",
    ]


def _times(cell: Cell, base: Cell | None, kind: Kind) -> list[str]:
    timing = cell.timing(kind)
    if timing is None:
        return ["–", "–", "–"]
    mebibytes = f"{timing.peak_bytes / 2**20:.0f}"
    return [milliseconds(timing.best_s), _ratio(timing, base, kind), mebibytes]


def milliseconds(seconds: float) -> str:
    """Three figures are all that a shared machine can promise."""
    value = 1e3 * seconds
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def _ratio(timing: Timing, base: Cell | None, kind: Kind) -> str:
    own = None if base is None else base.timing(kind)
    if own is None:
        return "–"
    ratio = timing.best_s / own.best_s
    return f"{ratio:.0f}" if ratio >= 100 else f"{ratio:.1f}" if ratio >= 10 else f"{ratio:.2f}"


def _checks(cell: Cell) -> list[str]:
    image, worst = cell.image, worst_gradient(cell.gradients)
    picture = ["–", "–", "–"]
    if image is not None:
        counts = f"{image.wrong} / {image.doubtful} / {image.sampled}"
        picture = [f"{image.psnr_db:.1f}", counts, f"{image.bias:+.0e}"]
    gradient = "–" if worst is None else f"{worst.relative_l2:.0e} {worst.parameter}"
    return [*picture, gradient, _verdict(cell)]


def _verdict(cell: Cell) -> str:
    if cell.image is None:
        return cell.reason or "not checked"
    found = verdict(cell.image, cell.gradients) if cell.judged else "not judged"
    return f"{found}; {cell.reason}" if cell.reason else found


def _plain(text: str) -> Text:
    return Text(text.replace("|", "/"))


def _text(table: Table) -> str:
    """The table as lines that Markdown understands; never wrapped."""
    target = io.StringIO()
    Console(file=target, width=400, highlight=False).print(table)
    return "\n".join(line.rstrip() for line in target.getvalue().strip().split("\n"))

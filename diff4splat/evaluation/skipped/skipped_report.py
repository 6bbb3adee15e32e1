"""``diff4splat report skipped``: a table and a picture of what runs leave out."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from diff4splat.evaluation.skipped.measurement import Measured
from diff4splat.evaluation.skipped.partial_rows import PartialRows
from diff4splat.io.atomic import write_text
from diff4splat.io.figures.plots import new_figure, save_figure

FORMAT = "diff4splat skipped 1"
COLORS = ("#0072B2", "#E69F00")


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedReport:
    """What was measured, and the files that hold it."""

    rows: Sequence[Measured]
    files: tuple[Path, ...]
    partial: PartialRows

    @property
    def plot(self) -> Path:
        """The picture."""
        return self.files[-1]


def by_item(rows: Sequence[Measured]) -> dict[str, list[Measured]]:
    """Rows of each item, in the order in which items first came."""
    items: dict[str, list[Measured]] = {}
    for row in rows:
        items.setdefault(row.item, []).append(row)
    return items


def to_markdown(rows: Sequence[Measured]) -> str:
    """One line per item: medians over the inputs, and the largest error."""
    lines = [
        "| left out | inputs | with, s | without, s | saved | bytes saved | largest error | PSNR |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for item, found in by_item(rows).items():
        full, lean = (
            _median(found, lambda row, k=k: getattr(row, k)) for k in ("full_s", "lean_s")
        )
        worst = max(found, key=lambda row: row.mean_square)
        same = "0, same bits" if worst.error == 0 else f"{worst.error:.1e}"
        psnr = "" if math.isinf(worst.psnr_db) else f"{worst.psnr_db:.1f} dB"
        saved = _median(found, lambda row: row.saved_bytes) / 1e6
        share = 1 - lean / full if full > 0 else 0.0
        lines.append(
            f"| {item} | {len(found)} | {full:.2f} | {lean:.2f} | {share:.0%} | {saved:.1f} MB | "
            f"{same} | {psnr} |"
        )
    return "\n".join(lines) + "\n"


def write_skipped(rows: Sequence[Measured], folder: Path) -> tuple[Path, ...]:
    """``skipped.json``, ``skipped.md`` and ``skipped.png``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        OutputError: the folder cannot be written.
    """
    files = tuple(folder / f"skipped.{suffix}" for suffix in ("json", "md", "png"))
    record = {"format": FORMAT, "rows": [asdict(row) for row in rows]}
    write_text(files[0], json.dumps(record, indent=1, allow_nan=False) + "\n")
    write_text(files[1], to_markdown(rows))
    save_skipped_plot(rows, files[2])
    return files


def save_skipped_plot(rows: Sequence[Measured], file: Path) -> None:
    """Processor seconds with and without each item; the error stands beside the bars."""
    items = by_item(rows)
    figure = new_figure(8.0, 0.62 * len(items) + 1.1)
    axes = figure.subplots()
    longest = 0.0
    for place, found in enumerate(items.values()):
        full, lean = (
            _median(found, lambda row, k=k: getattr(row, k)) for k in ("full_s", "lean_s")
        )
        for value, shift, color, label in (
            (full, -0.19, COLORS[1], "with"),
            (lean, 0.19, COLORS[0], "left out"),
        ):
            axes.barh(place + shift, value, 0.36, color=color, label="" if place else label)
        worst = max(row.error for row in found)
        note = "same bits" if worst == 0 else f"differs by {worst:.0e}"
        change = f"  {lean / full - 1:+.0%}, {note}"
        axes.text(max(full, lean), place, change, va="center", fontsize=8)
        longest = max(longest, full, lean)
    axes.set_yticks(range(len(items)), list(items), fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.35 * longest)
    axes.set_xlabel("processor seconds, median over the inputs")
    axes.set_title("What runs leave out: time and error", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    save_figure(figure, file)


def _seconds(rows: Sequence[Measured]) -> tuple[float, float]:
    """Medians with and without the work."""
    return _median(rows, lambda row: row.full_s), _median(rows, lambda row: row.lean_s)


def _median(rows: Sequence[Measured], value: Callable[[Measured], float]) -> float:
    values = sorted(float(value(row)) for row in rows)
    middle = len(values) // 2
    return values[middle] if len(values) % 2 else (values[middle - 1] + values[middle]) / 2

"""One evaluation from clips to files: measure or resume, summarise, write.

items.jsonl (written after every item)  results.json  results.md  items.png  differences.png
"""

from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.columns import PRIMARY, column_of
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.protocols.sources import ClipSource
from diff4splat.evaluation.report.difference_chart import difference_chart
from diff4splat.evaluation.report.qualitative_sheet import draw_sheet, make_strips
from diff4splat.evaluation.report.report_writer import to_json, to_markdown
from diff4splat.evaluation.report.result_store import NAME, ItemStore, run_key
from diff4splat.evaluation.report.summary import Summary, paired_differences, summarize
from diff4splat.evaluation.runner import Outcome, require_results, run_items
from diff4splat.io.atomic import atomic_folder
from diff4splat.io.photos.images import write_png
from diff4splat.progress.phases import Phases

OUTPUT_FILES = ("results.json", "results.md", "items.png", "differences.png")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Measured items and their summary."""

    outcome: Outcome
    summary: Summary
    markdown: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLimits:
    """Number of items to measure, and whether to reuse stored results."""

    limit: int | None = None
    """Measure only the first items; None measures all."""
    fresh: bool = False
    """Ignore stored results."""


def evaluate(
    source: ClipSource, setup: Setup, out: Path, limits: RunLimits, phases: Phases
) -> Evaluation:
    """Measure and write everything into ``out``.

    Raises:
        InputError: too few clips, or every item failed.
        FileFormatError: the stored results are damaged.
        OutputError: ``out`` cannot be written.
    """
    with atomic_folder(out, OUTPUT_FILES) as folder:
        store = ItemStore(out / NAME, run_key(setup), limits.fresh)
        outcome = require_results(run_items(source, setup, store, limits.limit, phases))
        summary = summarize(outcome)
        markdown = to_markdown(outcome, summary)
        (folder / "results.json").write_text(to_json(outcome, summary), encoding="utf-8")
        (folder / "results.md").write_text(markdown, encoding="utf-8")
        with phases.phase("draw items"):
            write_png(
                draw_sheet(outcome, make_strips(outcome, summary, source)), folder / "items.png"
            )
        write_png(_chart(outcome, summary), folder / "differences.png")
    return Evaluation(outcome=outcome, summary=summary, markdown=markdown)


def _chart(outcome: Outcome, summary: Summary) -> Float[Tensor, "h w 3"]:
    column = column_of(PRIMARY[outcome.setup.task])
    difference = summary.difference(column.key)
    if difference is None:
        return difference_chart([], f"{column.title}: no baseline to compare with")
    values = paired_differences(outcome.items, column, difference.baseline)
    title = f"{column.title} against {difference.baseline}, item by item; above the line is better"
    return difference_chart(values, title)

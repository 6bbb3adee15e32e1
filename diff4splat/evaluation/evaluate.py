"""One evaluation from clips to files: measure, take up what is there, summarise, write, draw.

items.jsonl (kept while measuring)  results.json  results.md  items.png  differences.png
"""

from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.chart import difference_chart
from diff4splat.evaluation.columns import PRIMARY, column_of
from diff4splat.evaluation.measuring import Setup
from diff4splat.evaluation.qualitative_sheet import draw_sheet, make_strips
from diff4splat.evaluation.report_writer import to_json, to_markdown
from diff4splat.evaluation.result_store import NAME, ItemStore, run_key
from diff4splat.evaluation.runner import Outcome, require_some, run_items
from diff4splat.evaluation.sources import ClipSource
from diff4splat.evaluation.summary import Summary, gains, summarize
from diff4splat.io.atomic import atomic_folder
from diff4splat.io.images import write_png
from diff4splat.progress.phases import Phases

OUTPUT_FILES = ("results.json", "results.md", "items.png", "differences.png")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What was measured and what it comes to."""

    outcome: Outcome
    summary: Summary
    markdown: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """How much of a protocol to measure, and whether to trust what is there."""

    limit: int | None = None
    """The first items only; None measures all."""
    fresh: bool = False
    """Measure again what was measured before."""


def evaluate(
    source: ClipSource, setup: Setup, out: Path, extent: Extent, phases: Phases
) -> Evaluation:
    """Measure and write everything into ``out``.

    Raises:
        InputError: too few clips, or every item failed.
        FileFormatError: earlier items are damaged.
        OutputError: ``out`` cannot be written.
    """
    with atomic_folder(out, OUTPUT_FILES) as folder:
        store = ItemStore(out / NAME, run_key(setup), extent.fresh)
        outcome = require_some(run_items(source, setup, store, extent.limit, phases))
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
    found = summary.difference(column.key)
    if found is None:
        return difference_chart([], f"{column.title}: no baseline to compare with")
    values = gains(outcome.items, column, found.baseline)
    title = f"{column.title} against {found.baseline}, item by item; above the line is better"
    return difference_chart(values, title)

"""Sections of the report that compare the system with other rows, item by item.

What the input hides: every fill and baseline in the same table, and the system against each. Each
network: the same scenes without it, and how much worse they are.
"""

from collections.abc import Sequence

from diff4splat.evaluation.columns import HIDDEN_REGIONS, SYSTEM, Column, columns_of
from diff4splat.evaluation.report.cells import head, line, mean_text, system_name, title
from diff4splat.evaluation.report.summary import FILLS, Summary
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.systems.baselines import BASELINES

ABLATION_KEYS = (
    *("psnr", "perceptual", "hidden_psnr", "hidden_perceptual", "depth_pearson", "depth_absrel"),
    *("track_error", "object_iou", "object_torn"),
    *("text_right", "text_both", "text_still", "text_object"),
    *("text_free", "text_absent"),
)
"""Columns in which networks are compared; ``results.json`` has all."""


def hidden_section(outcome: Outcome, summary: Summary) -> list[str]:
    """Hidden pixels of all rows, and the system against each of them."""
    columns = [c for c in _measured(outcome, summary) if c.table == "hidden"]
    columns = [c for c in columns if c.better != "neither"]
    if not columns:
        return []
    lines = ["## Hidden pixels", "", _shares(summary), "", *head([title(c) for c in columns])]
    for row in (SYSTEM, *BASELINES, *FILLS):
        means = [summary.cell(row, column.key) for column in columns]
        if any(mean is not None for mean in means):
            name = f"**{system_name(outcome)}**" if row == SYSTEM else row
            lines.append(line([name, *(mean_text(mean) for mean in means)]))
    lines += ["", "The system against each, item by item; above 0 the system is better.", ""]
    return lines + _differences(summary, columns, (*BASELINES, *FILLS))


def ablation_section(outcome: Outcome, summary: Summary) -> list[str]:
    """What each network adds; empty without ablations."""
    variants = outcome.setup.variants
    if not variants:
        return []
    compared = [c for c in _measured(outcome, summary) if c.key in ABLATION_KEYS]
    lines = [
        "## Each network",
        "",
        "The full system against the same scenes without the network, item by item: above 0 the "
        "network helps. 0 without an interval: it does not run, so nothing changes.",
        "",
        *head([title(column) for column in compared]),
    ]
    idle = {variant.row for variant in variants if variant.same}
    for variant in variants:
        means = [summary.comparison(variant.row, column.key) for column in compared]
        cells = ["0" if variant.row in idle and m else mean_text(m, "+") for m in means]
        lines.append(line([variant.row, *cells]))
    return lines


def _measured(outcome: Outcome, summary: Summary) -> list[Column]:
    keys = {cell.key for cell in summary.cells}
    return [column for column in columns_of(outcome.setup.task) if column.key in keys]


def _differences(summary: Summary, columns: Sequence[Column], rows: Sequence[str]) -> list[str]:
    lines = head([column.title for column in columns])
    for row in rows:
        means = [summary.comparison(row, column.key) for column in columns]
        if any(mean is not None for mean in means):
            lines.append(line([row, *(mean_text(mean, "+") for mean in means)]))
    return lines


def _shares(summary: Summary) -> str:
    """How many pixels the classes have."""
    shares = []
    for region in HIDDEN_REGIONS:
        mean = summary.cell(SYSTEM, f"{region}_share")
        shares.append(f"{region} {100 * mean.value:.1f} %" if mean else f"{region} none")
    return f"Of the target pixels: {', '.join(shares)}."

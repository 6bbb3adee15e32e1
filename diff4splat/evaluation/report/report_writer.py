"""Write results as Markdown and JSON.

The same items on the same machine give the same bytes.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict

from diff4splat import __version__
from diff4splat.evaluation.columns import PRIMARY, SYSTEM, Column, Table, columns_of
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.report.cells import head, line, mean_text, number, system_name, title
from diff4splat.evaluation.report.comparison_tables import ablation_section, hidden_section
from diff4splat.evaluation.report.distributions import (
    distribution_distances,
    distribution_section,
)
from diff4splat.evaluation.report.summary import Summary, row_names
from diff4splat.evaluation.runner import Outcome
from diff4splat.progress.machine import this_machine

SECTIONS: dict[Table, str] = {
    "objects": "Objects",
    "camera": "Camera",
    "diversity": "Spread over seeds",
    "videos": "Videos",
}
"""Smaller tables and their titles."""
VIDEO_COLUMNS = {"frames": "Consistency", "text": "CLIP score", "aesthetic": "Aesthetic"}
"""Columns of videos by what their network is for."""
FORMAT = "diff4splat-evaluation-results 1"


def to_json(outcome: Outcome, summary: Summary) -> str:
    """Protocol, system, table, differences and all items as JSON."""
    setup = outcome.setup
    record = {
        "format": FORMAT,
        "diff4splat": __version__,
        "machine": asdict(this_machine()),
        "task": setup.task,
        "protocol": setup.protocol.record() | {"digest": setup.protocol.digest},
        "subject": asdict(setup.system.identity),
        "features": None if setup.features is None else setup.features.name,
        "videos": setup.videos.names,
        "asked": outcome.requested,
        "subset": outcome.is_subset,
        "columns": [asdict(column) for column in columns_of(setup.task)],
        "table": [asdict(cell) for cell in summary.cells],
        "differences": [asdict(difference) for difference in summary.differences],
        "comparisons": [asdict(comparison) for comparison in summary.comparisons],
        "distributions": [asdict(distance) for distance in distribution_distances(outcome)],
        "skipped": [asdict(skipped) for skipped in summary.skipped],
        "failures": [asdict(failure) for failure in outcome.failures],
        "items": [item.to_json() for item in outcome.items],
    }
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def to_markdown(outcome: Outcome, summary: Summary) -> str:
    """Table, protocol, differences, and the best and worst items as Markdown."""
    columns = _filled(outcome, summary)
    images = [column for column in columns if column.table == "images"]
    names = {SYSTEM: f"**{system_name(outcome)}**"}
    others = [_section(outcome, summary, columns, table) for table in SECTIONS]
    parts = [
        _head(outcome),
        _table(outcome, summary, images),
        _differences(summary, images),
        hidden_section(outcome, summary),
        *others,
        distribution_section(outcome, distribution_distances(outcome), names),
        ablation_section(outcome, summary),
        _meanings(outcome, columns),
        _items(outcome, summary),
        _skipped(outcome, summary),
    ]
    return "\n\n".join("\n".join(lines) for lines in parts if lines) + "\n"


def _section(
    outcome: Outcome, summary: Summary, columns: Sequence[Column], table: Table
) -> list[str]:
    """One of the smaller tables; empty if nothing of it was measured."""
    shown = [column for column in columns if column.table == table]
    rows = _rows(outcome, summary, shown)
    if not rows:
        return []
    return [f"## {SECTIONS[table]}", "", *head([title(column) for column in shown]), *rows]


def _rows(outcome: Outcome, summary: Summary, columns: Sequence[Column]) -> list[str]:
    """Rows that have a value in any column."""
    lines = []
    for row in row_names(outcome):
        means = [summary.cell(row, column.key) for column in columns]
        if any(mean is not None for mean in means):
            name = f"**{system_name(outcome)}**" if row == SYSTEM else row
            lines.append(line([name, *(mean_text(mean) for mean in means)]))
    return lines


def _filled(outcome: Outcome, summary: Summary) -> list[Column]:
    """Columns with at least one value."""
    keys = {cell.key for cell in summary.cells}
    return [column for column in columns_of(outcome.setup.task) if column.key in keys]


def _head(outcome: Outcome) -> list[str]:
    setup, identity = outcome.setup, outcome.setup.system.identity
    weights = "random" if identity.weights_sha256 == "none" else identity.weights_sha256[:16]
    total = setup.protocol.items(setup.task)
    scope = f"{len(outcome.items)} of {outcome.requested} items"
    if outcome.is_subset:
        scope += f" (**subset**: the first {outcome.requested} of {total}; not comparable)"
    lines = [
        f"# Evaluation: {system_name(outcome)}, {setup.task}",
        "",
        f"Protocol {setup.protocol.name}, digest `{setup.protocol.digest}`; {scope}. "
        f"Weights {weights}, configuration `{identity.fingerprint}`. diff4splat {__version__}.",
    ]
    if setup.features is not None and setup.task != "text":
        lines.append(f"Perceptual distance: {setup.features.name}.")
    for purpose, name in VIDEO_COLUMNS.items():
        if purpose in setup.videos.names and setup.task != "text":
            lines.append(f"{name}: {setup.videos.names[purpose]}.")
    if identity.untrained:
        lines.append("**Untrained**: the weights are random; this row is a starting point.")
    return lines


def _table(outcome: Outcome, summary: Summary, columns: Sequence[Column]) -> list[str]:
    percent = f"{outcome.setup.protocol.bootstrap.coverage:.0%}"
    lines = [f"Means over items with {percent} bootstrap intervals.", ""]
    return lines + head([title(column) for column in columns]) + _rows(outcome, summary, columns)


def _differences(summary: Summary, columns: Sequence[Column]) -> list[str]:
    rows = [(c, row) for c in columns if (row := summary.difference(c.key)) is not None]
    if not rows:
        return []
    lines = [
        "Item by item against the best baseline of each measure; above 0 the system is better.",
        "",
        line(["measure", "best baseline", "difference", "items"]),
        line(["---", "---", "---:", "---:"]),
    ]
    for column, row in rows:
        cells = [column.title, row.baseline, mean_text(row.mean, sign="+"), str(row.mean.count)]
        lines.append(line(cells))
    return lines


def _meanings(outcome: Outcome, columns: Sequence[Column]) -> list[str]:
    lines = [f"- {column.title}: {column.meaning}." for column in columns]
    if outcome.setup.task != "text":
        lines.append("- The best plane is an oracle: it selects its depth with the target images.")
    return lines


def _items(outcome: Outcome, summary: Summary) -> list[str]:
    key = PRIMARY[outcome.setup.task]
    ranked_by = next(c.title for c in columns_of(outcome.setup.task) if c.key == key)
    return [f"- {name}: {_item(item, key)} {ranked_by}" for name, item in summary.examples()]


def _item(item: ItemResult, key: str) -> str:
    return f"item {item.item} ({item.clip}), {number(item.value(SYSTEM, key))}"


def _skipped(outcome: Outcome, summary: Summary) -> list[str]:
    failed = [f"- failed: item {f.item} ({f.clip}): {f.why}" for f in outcome.failures]
    # What a clip lacks is missing in every row: once is enough.
    of_system = {(s.key, s.why, s.items) for s in summary.skipped if s.row == SYSTEM}
    told = [
        s for s in summary.skipped if s.row == SYSTEM or (s.key, s.why, s.items) not in of_system
    ]
    skipped = [f"- not measured on {s.items} items: {s.key} of {s.row}: {s.why}" for s in told]
    return failed + skipped

"""The tables as Markdown for people and JSON for programs."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from ablations.course import TIMED
from ablations.results import COLUMNS, KEYS, Row, difference, mean
from ablations.variants import FULL, VARIANTS
from diff4splat import __version__
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.report.cells import DIRECTION_ARROWS, number
from diff4splat.evaluation.report.summary import Mean
from diff4splat.progress.machine import this_machine
from diff4splat.training.recipe.recipe import Recipe

FORMAT = "diff4splat-ablations 1"


def to_json(rows: Sequence[Row], base: Recipe, protocol: Protocol) -> str:
    """Everything, clip by clip."""
    record = {
        "format": FORMAT,
        "diff4splat": __version__,
        "machine": asdict(this_machine()),
        "recipe": base.name,
        "seed": base.seed,
        "protocol": protocol.record() | {"digest": protocol.digest},
        "changes": {variant.name: list(variant.changes) for variant in VARIANTS},
        "rows": [_record(row, rows[0], protocol) for row in rows],
    }
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def to_markdown(rows: Sequence[Row], base: Recipe, protocol: Protocol) -> str:
    """Means, differences to the full variant, and what the columns mean."""
    parts = [_head(rows, base, protocol), _means(rows, protocol)]
    if any(row.name not in ("", FULL.name) for row in rows):
        parts.append(_differences(rows, protocol))
    parts.append([f"- {column.title}: {column.meaning}." for column in COLUMNS])
    return "\n\n".join("\n".join(lines) for lines in parts) + "\n"


def _record(row: Row, full: Row, protocol: Protocol) -> dict[str, object]:
    means = {key: mean(row, key, protocol) for key in KEYS}
    against = {key: difference(row, full, key, protocol) for key in KEYS}
    return {
        "name": row.name or row.title,
        "title": row.title,
        "stages": [asdict(cost) for cost in row.costs],
        "means": {key: found and asdict(found) for key, found in means.items()},
        "differences": {key: found and asdict(found) for key, found in against.items()},
        "values": {key: row.values(key) for key in KEYS},
    }


def _head(rows: Sequence[Row], base: Recipe, protocol: Protocol) -> list[str]:
    stages = base.stages[1:]
    counts = [f"{stage.steps} of {stage.name}" for stage in stages]
    counts[0] = f"{stages[0].steps} steps of {stages[0].name}"
    size_px = stages[0].data.size_px
    count, whole = max(len(row.items) for row in rows), protocol.source.count
    return [
        "# Ablations of the reconstruction",
        "",
        f"Recipe {base.name}, seed {base.seed}, {size_px[1]} × {size_px[0]} px. The full variant "
        f"takes {', '.join(counts[:-1])} and {counts[-1]}; the others take about the same "
        f"processor seconds, in as many steps as a timing of {TIMED} steps allows. Seconds of "
        f"stages left out go to {stages[-1].name}. All start from the same autoencoder.",
        f"Protocol {protocol.name}, digest `{protocol.digest}`, reconstruction; the first {count} "
        f"of {whole} clips.",
        "One training each: intervals say how much means depend on the clips, not on the seed.",
        f"{this_machine()}.",
    ]


def _means(rows: Sequence[Row], protocol: Protocol) -> list[str]:
    titles = [f"{column.title} {DIRECTION_ARROWS[column.better]}" for column in COLUMNS]
    lines = [
        f"Means over clips with {protocol.bootstrap.coverage:.0%} bootstrap intervals.",
        "",
        _line(["", *titles, "steps", "processor s"]),
        _line(["---", *["---:"] * (len(titles) + 2)]),
    ]
    for row in rows:
        cells = [_mean(mean(row, key, protocol)) for key in KEYS]
        lines.append(_line([row.title, *cells, *_costs(row)]))
    return lines


def _costs(row: Row) -> list[str]:
    """Steps of every stage and seconds of all."""
    if not row.costs:
        return ["", ""]
    steps = " + ".join(f"{cost.steps}{'*' if cost.shared else ''}" for cost in row.costs)
    return [steps, f"{row.cpu_s:.0f}"]


def _differences(rows: Sequence[Row], protocol: Protocol) -> list[str]:
    full, others = rows[0], [row for row in rows[1:] if row.name]
    lines = [
        "\\* trained once, by the full variant.",
        "",
        "Variant minus full, clip by clip, over the clips that have both values.",
        "",
        _line(["", *(f"{column.title} {DIRECTION_ARROWS[column.better]}" for column in COLUMNS)]),
        _line(["---", *["---:"] * len(COLUMNS)]),
    ]
    for row in others:
        cells = [_mean(difference(row, full, key, protocol), sign="+") for key in KEYS]
        lines.append(_line([row.title, *cells]))
    return lines


def _mean(found: Mean | None, sign: str = "") -> str:
    if found is None:
        return ""
    text = number(found.value, sign)
    if found.low is None or found.high is None:
        return text
    return f"{text} [{number(found.low, sign)}, {number(found.high, sign)}]"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"

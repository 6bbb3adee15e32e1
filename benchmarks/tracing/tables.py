"""The rows as Markdown and JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.tracing.measuring import Row

_HEAD = (
    "| scene | way | ours, tree built | Mitsuba, built before | Mitsuba, built inside | faster by "
    "(worst turn) | faster by, both build |\n|---|---|---|---|---|---|---|\n"
)


def markdown(rows: Sequence[Row], machine: str) -> str:
    """Two tables: seconds, and how alike the images are."""
    text = f"{machine}\n\n{_HEAD}" + "".join(map(_seconds, rows))
    text += (
        "\n| scene | rays within 1e-5 | rays within 1e-2 | mean difference "
        "| cosine of gradients in means |\n|---|---|---|---|---|\n"
    )
    for row in rows:
        text += (
            f"| {row.scene} | {row.agree_share:.1%} | {row.close_share:.1%} "
            f"| {row.mean_difference:.1e} | {row.gradient_cosine:.4f} |\n"
        )
    return text


def as_json(rows: Sequence[Row], machine: str) -> str:
    return json.dumps({"machine": machine, "rows": [asdict(row) for row in rows]}, indent=2) + "\n"


def _seconds(row: Row) -> str:
    ways = {
        "forward": (row.ours_s, row.mitsuba_s, row.mitsuba_built_s, row.least_ratio),
        "forward + backward": (
            row.ours_both_s,
            row.mitsuba_both_s,
            row.mitsuba_both_built_s,
            row.least_both_ratio,
        ),
    }
    lines = ""
    for way, (ours, before, inside, least) in ways.items():
        lines += (
            f"| {row.scene} | {way} | {1e3 * ours:.1f} ms | {1e3 * before:.1f} ms "
            f"| {1e3 * inside:.1f} ms | {before / ours:.1f} ({least:.1f}) | {inside / ours:.1f} |\n"
        )
    return lines

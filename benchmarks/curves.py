"""Learning curves of a training run, one panel per stage.

Run ``python benchmarks/curves.py --run RUN --out curves.png``: loss terms as running medians on the
left axis, what evaluation measured on the right.
"""

import argparse
import json
import statistics
from pathlib import Path

from diff4splat.io.atomic import atomic_path
from diff4splat.io.figures.plots import require_matplotlib

TERMS = ("pixels", "photometric", "depth", "depth_log", "motion")
MEASURES = {"psnr": "PSNR [dB]", "depth_correlation": "depth r", "track_share": "EPE / still"}
WINDOW = 25
"""Steps of a running median: single batches say little."""


def rows_of(run: Path, stage: str) -> list[dict]:
    """The log of a stage; steps that were taken again after a stop count once."""
    rows = [json.loads(line) for line in (run / stage / "log.jsonl").read_text().splitlines()]
    return list({(row["event"], row.get("step")): row for row in rows}.values())


def smoothed(values: list[float]) -> list[float]:
    """Running medians."""
    half = WINDOW // 2
    return [
        statistics.median(values[max(place - half, 0) : place + half + 1])
        for place in range(len(values))
    ]


def draw(axes, stage: str, rows: list[dict]) -> None:
    """Terms against steps, and points of evaluation."""
    steps = [row for row in rows if row["event"] == "step"]
    for term in TERMS:
        shown = [row for row in steps if f"loss/{term}" in row]
        if shown:
            values = smoothed([row[f"loss/{term}"] for row in shown])
            axes.plot([row["step"] for row in shown], values, label=term, linewidth=1.2)
    axes.set_yscale("log")
    axes.set_xlabel("step")
    evaluations = [row for row in rows if row["event"] == "evaluation"]
    said = [
        f"{title} {evaluations[-1][key]:.3g}"
        for key, title in MEASURES.items()
        if evaluations and key in evaluations[-1]
    ]
    axes.set_title("\n".join([stage, ", ".join(said[:2]), *said[2:]]), fontsize=9)
    axes.legend(fontsize=7)


def main() -> None:
    """One panel for every stage that was begun."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, required=True)
    parser.add_argument("--stages", nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    require_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(options.stages), 3.0), layout="constrained")
    panels = figure.subplots(1, len(options.stages), squeeze=False)[0]
    for axes, stage in zip(panels, options.stages, strict=True):
        draw(axes, stage, rows_of(options.run, stage))
    with atomic_path(options.out) as temporary:
        figure.savefig(temporary, dpi=140, format="png")


if __name__ == "__main__":
    main()

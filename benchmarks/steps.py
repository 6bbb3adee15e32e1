"""Seconds per step and the share spent waiting for data, for stages of a recipe.

Run ``python benchmarks/steps.py --clips FOLDER --out FILE.md``: every stage a few steps with clips
made beforehand, and with worlds drawn meanwhile. The first steps do not count: workers start then.
"""

import os

# Threads that wait must sleep: on two cores, spinning ones take the time of the worker.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import argparse
import json
import statistics
import tempfile
from dataclasses import replace
from pathlib import Path

from diff4splat.configs.recipes import recipe_by_name, with_clips
from diff4splat.io.atomic import write_text
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.train_stage import StageRequest, train_stage

WARM_UP = 3
HEAD = "| stage | clips | s per step | waiting | samples per s |\n|---|---|---|---|---|\n"


def measure(recipe: Recipe, stage: str, folder: Path, steps: int) -> list[dict[str, float]]:
    """Log rows of the steps that count."""
    request = StageRequest(
        recipe=recipe,
        stage=stage,
        folder=folder,
        ignore_gates=True,
        stop_after_steps=steps + WARM_UP,
    )
    train_stage(request)
    rows = [json.loads(line) for line in (folder / stage / "log.jsonl").read_text().splitlines()]
    return [row for row in rows if row["event"] == "step"][WARM_UP:]


def row(stage: str, source: str, steps: list[dict[str, float]]) -> str:
    """One line of the table: medians, and the share of all waiting in all seconds."""
    seconds = statistics.median(step["seconds"] for step in steps)
    waited = sum(step["waiting_share"] * step["seconds"] for step in steps)
    share = waited / sum(step["seconds"] for step in steps)
    rate = statistics.median(step["samples_per_s"] for step in steps)
    return f"| {stage} | {source} | {seconds:.2f} | {share:.1%} | {rate:.2f} |\n"


def main() -> None:
    """Every stage with both sources."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", default="small")
    parser.add_argument("--clips", type=Path, required=True, help="folder of shards")
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    parser.add_argument("--steps", type=int, default=8)
    parser.add_argument("--stages", nargs="*", help="names; all if left out")
    parser.add_argument("--worlds", nargs="*", default=["vae"], help="stages that also draw worlds")
    options = parser.parse_args()
    recipe = recipe_by_name(options.config)
    recipe = replace(recipe, trainer=replace(recipe.trainer, evaluation_samples=0))
    shards, table = with_clips(recipe, options.clips), HEAD
    with tempfile.TemporaryDirectory() as temporary:
        for stage in options.stages or [stage.name for stage in recipe.stages]:
            done = measure(shards, stage, Path(temporary) / "shards", options.steps)
            table += row(stage, "made beforehand", done)
            if stage in options.worlds:
                done = measure(recipe, stage, Path(temporary) / "worlds", options.steps)
                table += row(stage, "drawn meanwhile", done)
            print(table.splitlines()[-1], flush=True)
    write_text(options.out, table)


if __name__ == "__main__":
    main()

"""What two processes cost and save in training, beside one: memory per process and time per step.

Run ``python benchmarks/parallel/parallel.py --out FOLDER``, with ``--factory module:function`` for
another stage than the toy. The function takes nothing and returns (Stage, Samples, StageRecipe).
All modes take the same global batch; the first steps of each do not count, and the median of the
rest does. Memory is the peak before the last step, above that of an idle process with everything
imported, or what PyTorch allocated on a GPU. Writes ``parallel.md`` and ``parallel.json``.
"""

import argparse
import importlib
import json
import os
import socket
import statistics
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.progress.phases import peak_memory_bytes

if TYPE_CHECKING:
    from diff4splat.training.recipe.stage import StageRecipe
    from diff4splat.training.stage import Stage
    from diff4splat.training.trainer.loading.samples import Samples

MODES = (("none", 1), ("ddp", 2), ("fsdp2", 2))
WARM_UP, TIMEOUT_S = 3, 1800
MIB = 1 << 20


@dataclass(frozen=True, kw_only=True)
class Row:
    """One mode."""

    mode: str
    processes: int
    step_s: float
    peak_mib: float
    """Of the process that needed most."""


def toy() -> "tuple[Stage, Samples, StageRecipe]":
    """Eight wide blocks that learn to copy noise: all weights, hardly any activations."""
    from parallel_toy import ToySamples, ToyStage, toy_recipe

    return ToyStage(), ToySamples(), toy_recipe()


def find_factory(name: str):
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function) if function else globals()[name]


def work(mode: str, options: argparse.Namespace) -> None:
    """One process of one mode: train, then leave its figures in a file."""
    import torch

    from diff4splat.training.recipe.trainer import TrainerSettings
    from diff4splat.training.trainer.loop.fit import fit_stage
    from diff4splat.training.trainer.settings import RunSettings

    make, idle = find_factory(options.factory), peak_memory_bytes()
    stage, samples, recipe = make()
    peak = 0

    class Watched:
        """Looks at the memory whenever a batch is made, so that checkpoints do not count."""

        def __getitem__(self, sample_index: int) -> object:
            return samples[sample_index]

        def collate(self, found):
            nonlocal peak
            on_gpu = torch.cuda.is_available() and options.device != "cpu"
            peak = torch.cuda.max_memory_allocated() if on_gpu else peak_memory_bytes() - idle
            return samples.collate(found)

    trainer = TrainerSettings(
        parallel=mode, precision=options.precision, evaluation_samples=0, checkpoint_every=1 << 30
    )
    folder = options.out / "runs" / mode
    run = RunSettings(
        folder=folder, seed=0, fingerprint="benchmark", trainer=trainer, device=options.device
    )
    steps = WARM_UP + options.steps
    recipe = replace(recipe, steps=steps, data=replace(recipe.data, workers=0))
    fit_stage(stage, Watched(), recipe, run)
    rank = os.environ.get("RANK", "0")
    (folder / f"peak-{rank}.json").write_text(json.dumps(peak))


def measure(mode: str, processes: int, options: argparse.Namespace) -> Row:
    """Start the processes of a mode and read what they left."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    shared = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "WORLD_SIZE": str(processes)}
    # The C library would keep the weights that FSDP2 frees after every block, hiding what it saves.
    shared["MALLOC_MMAP_THRESHOLD_"] = str(1 << 17)
    running = [
        subprocess.Popen(
            [sys.executable, *sys.argv, "--worker", mode],
            env=os.environ | shared | {"RANK": str(rank), "LOCAL_RANK": str(rank)},
        )
        for rank in range(processes)
    ]
    try:
        codes = [process.wait(TIMEOUT_S) for process in running]
    finally:
        for process in running:
            process.kill()
    if any(codes):
        raise SystemExit(f"{mode}: processes ended with {codes}")
    folder = options.out / "runs" / mode
    rows = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    seconds = [row["seconds"] for row in rows if row["event"] == "step"]
    peaks = [json.loads(path.read_text()) for path in folder.glob("peak-*.json")]
    return Row(
        mode=mode,
        processes=processes,
        step_s=statistics.median(seconds[WARM_UP:]),
        peak_mib=max(peaks) / MIB,
    )


def table(rows: list[Row]) -> str:
    """Markdown with ratios to the first row."""
    lines = [
        "| mode | processes | s per step | × one | peak MiB per process | × one |",
        "|---|---|---|---|---|---|",
    ]
    first = rows[0]
    for row in rows:
        lines.append(
            f"| {row.mode} | {row.processes} | {row.step_s:.3f} | {row.step_s / first.step_s:.2f} "
            f"| {row.peak_mib:.0f} | {row.peak_mib / max(first.peak_mib, 1e-9):.2f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--factory", default="toy")
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--precision", default="float32", choices=("float32", "bfloat16"))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--worker", choices=[mode for mode, _ in MODES])
    options = parser.parse_args()
    if options.worker:
        work(options.worker, options)
        return
    if (options.out / "runs").exists():
        raise SystemExit(f"{options.out / 'runs'}: expected a new folder, got an old one")
    rows = [measure(mode, processes, options) for mode, processes in MODES]
    (options.out / "parallel.md").write_text(table(rows))
    (options.out / "parallel.json").write_text(json.dumps([asdict(r) for r in rows], indent=2))
    print(table(rows), end="")


if __name__ == "__main__":
    main()

"""One process of a toy run, as ``torchrun`` would start it: ``python toy_process.py FILE``.

The file is a JSON list of calls, made one after another; each says where its weights go. A call may
ask this process to kill itself as a rank at a sample, or in the middle of a checkpoint.
"""

import json
import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.cli.main import leave
from diff4splat.training.trainer.checkpoints import store as checkpoint
from diff4splat.training.trainer.distributed.processes import open_processes
from diff4splat.training.trainer.loop.fit import fit_stage


@dataclass(frozen=True)
class Deadly(ToySamples):
    """Sends a signal to the process that asks for a sample."""

    at: int = -1
    number: int = signal.SIGKILL

    def __getitem__(self, sample_index: int) -> object:
        if sample_index == self.at:
            os.kill(os.getpid(), self.number)
        return super().__getitem__(sample_index)


def die_while_saving(step: int) -> None:
    """This process is killed when the checkpoint of a step is half written."""
    write = checkpoint.write_tensors

    def deadly(folder: Path, tensors: dict) -> None:
        if folder.name.endswith(f"{step:08d}"):
            (folder / "shard-half.safetensors").write_bytes(b"half")
            os.kill(os.getpid(), signal.SIGKILL)
        write(folder, tensors)

    checkpoint.write_tensors = deadly


def call(asked: dict) -> None:
    samples = Deadly(
        nan_at=frozenset(asked.get("nan_at", ())),
        unusable=frozenset(asked.get("unusable", ())),
        at=asked.get("signal_at", -1),
        number=asked.get("signal", signal.SIGKILL),
    )
    if asked.get("die_while_saving") is not None and os.environ["RANK"] == "1":
        die_while_saving(asked["die_while_saving"])
    stage = ToyStage()
    run = toy_run(Path(asked["folder"]), **asked.get("run", {}))
    result = fit_stage(stage, samples, Toy(**asked.get("toy", {})).recipe(), run)
    found = weights(stage) | {"outcome": result.outcome, "measures": result.measures}
    torch.save(found, f"{asked['folder']}/rank-{os.environ['RANK']}.pt")


def main() -> None:
    torch.set_num_threads(1)
    calls = json.loads(Path(sys.argv[1]).read_text())
    with open_processes("ddp", "cpu", timeout_s=120.0):
        for asked in calls:
            call(asked)
    # As the command line ends. Threads of Gloo outlive their group, which torch's own modules hold,
    # and may abort an interpreter that takes itself apart.
    leave(0)


if __name__ == "__main__":
    main()

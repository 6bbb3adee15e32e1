"""One of two processes that share tokens and weights: ``python sharing_process.py FOLDER``.

Writes gradients of networks whose tokens are shared, and how much memory sharded weights took.
"""

import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import nn
from torch.distributed.tensor import DTensor

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks, plan_networks
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.video_dit.dit import VideoDiT
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.stage import Stage
from diff4splat.training.starting_weights import StartingWeights
from diff4splat.training.trainer.distributed.parallel import parallelise
from diff4splat.training.trainer.distributed.processes import Processes, open_processes

WIDE = replace(
    tiny_size(),
    dit=replace(tiny_size().dit, width=768, heads=12, blocks=8, feedforward_width=3072),
)
"""About 300 MB of weights, of which a block has an eighth."""


class OnePart(Stage):
    """The video model alone; it is never called."""

    trained = ("dit",)

    def __init__(self, dit: nn.Module) -> None:
        super().__init__()
        self.dit = dit


@dataclass(frozen=True)
class Memory:
    """Bytes of this process above those at the start."""

    start: int

    @classmethod
    def now(cls) -> "Memory":
        Path("/proc/self/clear_refs").write_text("5")  # forgets the peak so far
        return cls(_status("VmRSS"))

    def peak(self) -> int:
        return _status("VmHWM") - self.start


def _status(field: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith(field + ":"))
    return 1024 * int(line.split()[1])


def sharded_peak(processes: Processes, config: ModelConfig) -> dict[str, int]:
    """Weights made sharded: peak memory, and what a process holds in the end."""
    memory = Memory.now()
    networks, initial = plan_networks(config, {"dit"}, seed=3)
    stage = OnePart(networks.dit)
    fill = StartingWeights(seed=3, initial=initial).fill
    parallelise(stage, processes, TrainerSettings(parallel="fsdp2"), fill)
    peak = memory.peak()
    held = sum(_local_bytes(weight) for weight in stage.parameters())
    return {"peak": peak, "held": held, "same": _equal_to_whole(stage, config)}


def _equal_to_whole(stage: Stage, config: ModelConfig) -> bool:
    whole = create_networks(config, parts={"dit"}, seed=3).dit.state_dict()
    found = stage.dit.state_dict()
    equal = [torch.equal(value.full_tensor(), whole[key]) for key, value in found.items()]
    return all(equal) and found.keys() == whole.keys()


def _local_bytes(weight: nn.Parameter) -> int:
    return (weight.to_local() if isinstance(weight, DTensor) else weight).nbytes


def outputs_and_gradients(sharing: object, name: str) -> dict[str, torch.Tensor]:
    """Of one network on fixed inputs; gradients are averaged over processes as the trainer does."""
    torch.manual_seed(0)
    network = (VideoDiT if name == "dit" else Ldrm)(tiny_size()).double()
    with torch.no_grad():
        for weight in network.parameters():
            weight.add_(0.05 * torch.randn_like(weight))
    network.share_tokens(sharing)
    latent, rays = torch.randn(2, 4, 2, 4, 4).double(), torch.randn(2, 6, 5, 32, 32).double()
    inputs = [value.requires_grad_(True) for value in (latent, rays)]
    if name == "dit":
        text, level = torch.randn(2, 3, 16).double(), torch.full((2, 2), 0.3).double()
        output = network.velocity(inputs[0], level, network.prepare(inputs[1], text))
    else:
        output = network(*inputs).gaussians
    (output * torch.randn_like(output)).sum().backward()
    found = {key: value.grad for key, value in network.named_parameters()}
    found |= {"latent": latent.grad, "rays": rays.grad}
    if sharing is not None:
        for value in found.values():
            torch.distributed.all_reduce(value)
            value.div_(sharing.count)
    return {"output": output.detach(), **found}


def main(folder: Path) -> None:
    torch.set_num_threads(1)
    with open_processes("fsdp2", "cpu", 120.0, per_sample=2) as processes:
        rank = os.environ["RANK"]
        alone = replace(processes, sharing=None)
        sharded_peak(alone, tiny_size())  # loads what PyTorch loads when it is first needed
        found = sharded_peak(alone, WIDE)
        (folder / f"memory-{rank}.json").write_text(json.dumps(found))
        for name in ("dit", "ldrm"):
            found = outputs_and_gradients(processes.sharing, name)
            torch.save(found, folder / f"{name}-{rank}.pt")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

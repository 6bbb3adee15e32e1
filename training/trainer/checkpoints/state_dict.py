"""Which tensors make up a run, by the names they have in checkpoints.

    model.<part>.<key>   weights and buffers of trained parts; of frozen ones when asked
    ema.<part>.<key>     averages of trained weights
    optimizer.<part>.<key>.{step,exp_avg,exp_avg_sq}

Keys are those of the part's ``state_dict``, whatever the process count.
"""

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.checkpoints.merged import AVERAGE, MODEL, MergedCheckpoint
from diff4splat.training.trainer.checkpoints.tensor_store import read_tensors
from diff4splat.training.trainer.distributed.parallel import trained_parameters
from diff4splat.training.trainer.loop.ema import WeightAverages
from diff4splat.training.trainer.loop.optim import part_of

OPTIMIZER = "optimizer."


def run_tensors(
    stage: Stage, averages: WeightAverages, optimizer: torch.optim.Optimizer
) -> dict[str, Tensor]:
    """Everything a run of its own needs to go on, sharing memory with it."""
    tensors = {MODEL + key: value for key, value in part_tensors(stage, stage.trained).items()}
    tensors |= {AVERAGE + name: value for name, value in averages.averages.items()}
    for name, parameter in trained_parameters(stage).items():
        moments = optimizer.state[parameter]
        tensors |= {f"{OPTIMIZER}{name}.{kind}": value for kind, value in moments.items()}
    return tensors


def frozen_tensors(stage: Stage) -> dict[str, Tensor]:
    """The parts that do not learn."""
    frozen = tuple(name for name, _ in stage.named_children() if name not in stage.trained)
    return {MODEL + key: value for key, value in part_tensors(stage, frozen).items()}


def part_tensors(stage: Stage, parts: tuple[str, ...]) -> dict[str, Tensor]:
    """Weights and buffers, sharing memory."""
    return {
        f"{part}.{key}": value
        for part in parts
        for key, value in stage.get_submodule(part).state_dict().items()
    }


def take_over(
    stage: Stage, averages: WeightAverages, folder: Path, updates: Mapping[str, int]
) -> tuple[str, ...]:
    """Weights and averages of an earlier stage's checkpoint; returns the parts it had.

    Parts that learn here get the raw weights and, beside them, the averages; parts that are frozen
    here get the averages. Parts that the checkpoint lacks stay as they are, with fresh averages.
    Low-rank corrections that a part has otherwise here, or not at all, are folded into its weights.

    Raises:
        CheckpointError: a part is stored there with other keys or shapes, or none is.
    """
    checkpoint = MergedCheckpoint.open(folder)
    parts = tuple(
        name
        for name, _ in stage.named_children()
        if any(key.startswith(f"{MODEL}{name}.") for key in checkpoint.shapes)
    )
    if not parts:
        raise CheckpointError(
            f"{folder}: expected parts of this stage, got none; choose the stage before this one"
        )
    continued = set()
    for part in parts:
        weights = part_tensors(stage, (part,))
        if checkpoint.fits(weights):
            continued |= _read_part(checkpoint, stage, averages, weights)
        else:
            continued |= _read_merged(checkpoint, averages, weights)
    averages.restart(set(stage.trained) - continued)
    averages.updates |= {part: updates.get(part, 0) for part in continued & set(stage.trained)}
    return parts


def _read_part(
    checkpoint: MergedCheckpoint,
    stage: Stage,
    averages: WeightAverages,
    weights: Mapping[str, Tensor],
) -> set[str]:
    """Weights and averages as they are stored; the parts whose averages go on."""
    wanted = {}
    for key, tensor in weights.items():
        averaged = part_of(key) not in stage.trained and AVERAGE + key in checkpoint.shapes
        wanted[(AVERAGE if averaged else MODEL) + key] = tensor
    wanted |= {
        AVERAGE + name: value
        for name, value in averages.averages.items()
        if name in weights and AVERAGE + name in checkpoint.shapes
    }
    read_tensors(checkpoint.folder, wanted)
    return {part_of(key.removeprefix(AVERAGE)) for key in wanted if key.startswith(AVERAGE)}


def _read_merged(
    checkpoint: MergedCheckpoint, averages: WeightAverages, weights: Mapping[str, Tensor]
) -> set[str]:
    """With the corrections of other networks folded in; own ones begin at their initial values."""
    (part,) = {part_of(key) for key in weights}
    mine = {name: value for name, value in averages.averages.items() if name in weights}
    learning = {name: value for name, value in weights.items() if name in mine}
    frozen = {name: value for name, value in weights.items() if name not in mine}
    checkpoint.read(frozen, averaged=True)
    checkpoint.read(learning, averaged=False)
    averages.restart({part})
    checkpoint.read(mine, averaged=True)
    return {part}

"""Weights of a checkpoint as plain safetensors, one file per model part, as networks load them."""

from pathlib import Path
from typing import Literal

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.training.trainer.checkpoints.merged import AVERAGE, MODEL
from diff4splat.training.trainer.checkpoints.tensor_store import read_tensors, stored_shapes
from diff4splat.training.trainer.loop.optim import part_of

Kind = Literal["averaged", "raw"]


def load_parts(checkpoint: Path, kind: Kind = "averaged") -> dict[str, dict[str, Tensor]]:
    """Part to key to tensor, whole and on the CPU; keys as in the part's ``state_dict``.

    Raises:
        CheckpointError: the folder holds no weights.
        FileFormatError: it is damaged.
    """
    shapes = stored_shapes(checkpoint)
    keys = [key.removeprefix(MODEL) for key in shapes if key.startswith(MODEL)]
    if not keys:
        raise CheckpointError(f"{checkpoint}: expected a checkpoint with weights, got none")
    averaged = {key for key in keys if kind == "averaged" and AVERAGE + key in shapes}
    names = {key: (AVERAGE if key in averaged else MODEL) + key for key in sorted(keys)}
    found = {key: torch.empty(shapes[name]) for key, name in names.items()}
    read_tensors(checkpoint, {names[key]: tensor for key, tensor in found.items()})
    parts: dict[str, dict[str, Tensor]] = {}
    for key, tensor in found.items():
        parts.setdefault(part_of(key), {})[key.partition(".")[2]] = tensor
    return parts

"""Weights of a checkpoint as plain safetensors, one file per model part, as networks load them."""

from pathlib import Path
from typing import Literal

import torch
from safetensors.torch import save_file
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.io.atomic import atomic_path
from diff4splat.models.weights import part_file
from diff4splat.training.trainer.contents import AVERAGE, MODEL
from diff4splat.training.trainer.optim import part_of
from diff4splat.training.trainer.tensor_store import read_tensors, stored_shapes

Kind = Literal["averaged", "raw"]


def export_weights(
    checkpoint: Path, folder: Path, kind: Kind = "averaged", dtype: torch.dtype = torch.float32
) -> tuple[Path, ...]:
    """Write ``<part>.safetensors`` for every part in the checkpoint; returns the files.

    Buffers, and frozen parts that were stored, have no averages: they are written as they are.
    Works in one process on what any number of processes wrote.

    Raises:
        CheckpointError: a weight is not finite in ``dtype``, or there are none.
        OutputError: the folder cannot be written.
    """
    files = []
    for part, tensors in load_parts(checkpoint, kind).items():
        cast = {key: value.to(dtype).contiguous() for key, value in tensors.items()}
        _require_finite(part, cast)
        with atomic_path(part_file(folder, part)) as temporary:
            save_file(cast, temporary)
        files.append(part_file(folder, part))
    return tuple(files)


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


def _require_finite(part: str, tensors: dict[str, Tensor]) -> None:
    for key, value in tensors.items():
        if not bool(torch.isfinite(value).all()):
            raise CheckpointError(
                f"{part} weights: expected finite numbers in {key} as {value.dtype}, got NaN or "
                "infinity; export float32 or another checkpoint"
            )

"""Weights of feature networks from files of tensors by name; nothing in them is executed."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from safetensors.torch import load_file
from torch import Tensor

from diff4splat.errors import CheckpointError, FileFormatError

MAX_LISTED = 4
"""Names listed in an error message before "and so on"."""


def read_tensors(file: Path) -> dict[str, Tensor]:
    """Tensors of a safetensors or torch file.

    Raises:
        CheckpointError: there is no such file.
        FileFormatError: it is damaged, or holds something other than tensors.
    """
    if not file.is_file():
        raise CheckpointError(f"{file}: expected a weight file, got none; check the path")
    try:
        if file.suffix == ".safetensors":
            return load_file(file)
        tensors = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # what damaged bytes make the two readers raise is not documented
        raise FileFormatError(
            f"{file}: expected safetensors or a torch file of tensors, got something else; "
            "fetch the weights again"
        ) from error
    if not isinstance(tensors, dict) or not all(isinstance(v, Tensor) for v in tensors.values()):
        raise FileFormatError(
            f"{file}: expected tensors by name, got {type(tensors).__name__}; save a state_dict"
        )
    return tensors


def require_weights(
    tensors: Mapping[str, Tensor], wanted: Mapping[str, tuple[int, ...]], what: str
) -> dict[str, Tensor]:
    """The wanted weights in float32.

    Raises:
        CheckpointError: one is missing, has another shape or is not finite.
    """
    refuse([key for key in wanted if key not in tensors], f"{what}: missing")
    refuse(
        [
            f"{key} {tuple(tensors[key].shape)} instead of {shape}"
            for key, shape in wanted.items()
            if tuple(tensors[key].shape) != shape
        ],
        f"{what}: wrong shape of",
    )
    weights = {key: tensors[key].float() for key in wanted}
    refuse([key for key in wanted if not weights[key].isfinite().all()], f"{what}: not finite in")
    return weights


def refuse(problems: Sequence[str], what: str) -> None:
    """Refuse weights that have problems.

    Raises:
        CheckpointError: there are problems.
    """
    if problems:
        listed = ", ".join(problems[:MAX_LISTED]) + (", …" if len(problems) > MAX_LISTED else "")
        raise CheckpointError(f"{what} {len(problems)} ({listed}); choose files of that network")


def digest(weights: Mapping[str, Tensor]) -> str:
    """SHA-256 of names and values."""
    found = hashlib.sha256()
    for key in sorted(weights):
        found.update(key.encode())
        found.update(weights[key].cpu().contiguous().numpy().data)
    return found.hexdigest()

"""Checkpoints of a fit: parameters, Adam moments, gradient statistics and progress in one file.

The file is written under a temporary name and renamed, so an interrupted write keeps the previous
checkpoint.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.training.config_codec import TypedReader

CHECKPOINT_FILE = "checkpoint.safetensors"
CHECKPOINT_FORMAT = "diff4splat-fit-1"
_MAX_STEPS = 1 << 40


@dataclass(frozen=True, slots=True, kw_only=True)
class FitState:
    """Progress and parameters of a fit at one step."""

    stage: str
    step: int
    """Completed steps of the stage."""
    fingerprint: str
    """Hash of settings and capture; a different hash means a different fit."""
    seconds: float
    """Time spent so far."""
    tensors: dict[str, Tensor]
    """Content of the parameter table."""
    moving_mask: Bool[Tensor, " n"]
    """Gaussians that the motion deforms."""
    fixed: dict[str, Tensor]
    """Tensors that the stage needs but does not optimise, such as the bounds of the planes."""


def save_checkpoint(state: FitState, folder: Path) -> None:
    """Write ``state`` atomically.

    Raises:
        OutputError: the folder cannot be created or written.
    """
    tensors = {f"table/{name}": value for name, value in state.tensors.items()}
    tensors |= {f"fixed/{name}": value for name, value in state.fixed.items()}
    tensors["moves"] = state.moving_mask.long()
    progress = {
        "stage": state.stage,
        "step": state.step,
        "fingerprint": state.fingerprint,
        "seconds": state.seconds,
    }
    metadata = {"format": CHECKPOINT_FORMAT, "fit": json.dumps(progress)}
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), folder / CHECKPOINT_FILE)


def load_checkpoint(folder: Path, fingerprint: str) -> FitState | None:
    """Read the checkpoint in ``folder``; None if there is no file.

    Raises:
        CheckpointError: the checkpoint belongs to another fit, or the file is something else.
        FileFormatError: the file is damaged.
    """
    file = folder / CHECKPOINT_FILE
    if not file.exists() and not file.is_symlink():
        return None
    metadata = read_metadata(file)
    if metadata.get("format") != CHECKPOINT_FORMAT:
        raise CheckpointError(f"{file}: expected a checkpoint of a fit, got another file")
    try:
        progress = _READER.read(_Progress, decode_json(metadata.get("fit", "")), "'fit'")
        tensors = _finite_tensors(read_tensors(file))
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}; start again with --restart") from error
    if progress.fingerprint != fingerprint:
        raise CheckpointError(
            f"{file}: expected the settings and data of the fit that began here, got others; "
            "choose another --out, or --restart"
        )
    return FitState(
        stage=progress.stage,
        step=progress.step,
        fingerprint=fingerprint,
        seconds=progress.seconds,
        tensors=_with_prefix(tensors, "table/"),
        moving_mask=tensors["moves"].bool(),
        fixed=_with_prefix(tensors, "fixed/"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Progress:
    """The text part of the file."""

    stage: Literal["coarse", "fine"]
    step: int
    fingerprint: str
    seconds: float

    def __post_init__(self) -> None:
        if not (0 <= self.step < _MAX_STEPS and 0 <= self.seconds < math.inf):
            raise FileFormatError(f"'fit': expected steps and seconds, got {self.step}")


_READER = TypedReader(error_type=FileFormatError)


def _finite_tensors(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """All of them, with the mask of moving Gaussians among them."""
    mask = tensors.get("moves")
    if mask is None or mask.ndim != 1 or mask.dtype != torch.int64:
        raise FileFormatError("moves: expected whole numbers, one per Gaussian, got others")
    for name, value in tensors.items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise FileFormatError(f"{name[:60]}: expected finite numbers, got NaN or infinity")
    return tensors


def _with_prefix(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {
        name.removeprefix(prefix): torch.as_tensor(value)
        for name, value in tensors.items()
        if name.startswith(prefix)
    }

"""A fit on disk: all numbers, moments, pulls and where it stands; one ``.safetensors`` file.

Written under another name and renamed, so that whatever stops a fit leaves the one before.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)

FILE = "checkpoint.safetensors"
FORMAT = "diff4splat-fit-1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """How far a fit is."""

    stage: str
    step: int
    fingerprint: str
    """Of settings and capture; another one belongs to another fit."""
    seconds: float
    """Spent so far."""
    tensors: dict[str, Tensor]
    """Of the table."""
    moves: Bool[Tensor, " n"]
    fixed: dict[str, Tensor]
    """What the stage was built with, such as the bounds of the planes."""


def save(standing: Standing, folder: Path) -> None:
    """Write whole or not at all.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    tensors = {f"table/{name}": value for name, value in standing.tensors.items()}
    tensors |= {f"fixed/{name}": value for name, value in standing.fixed.items()}
    tensors["moves"] = standing.moves.long()
    text = {
        "stage": standing.stage,
        "step": standing.step,
        "fingerprint": standing.fingerprint,
        "seconds": standing.seconds,
    }
    content = TensorFile(tensors=tensors, metadata={"format": FORMAT, "fit": json.dumps(text)})
    write_tensors(content, folder / FILE)


def load(folder: Path, fingerprint: str) -> Standing | None:
    """How far the fit in ``folder`` is; None where none has begun.

    Raises:
        CheckpointError: the checkpoint is of another fit or not one of ours.
        FileFormatError: the file is damaged.
    """
    file = folder / FILE
    if not file.exists():
        return None
    metadata = read_metadata(file)
    if metadata.get("format") != FORMAT:
        raise CheckpointError(f"{file}: expected a checkpoint of a fit, got another file")
    text = json.loads(metadata["fit"])
    if text["fingerprint"] != fingerprint:
        raise CheckpointError(
            f"{file}: expected the settings and data of the fit that began here, got others; "
            "choose another --out, or --restart"
        )
    tensors = read_tensors(file)
    return Standing(
        stage=text["stage"],
        step=text["step"],
        fingerprint=fingerprint,
        seconds=text["seconds"],
        tensors=_under(tensors, "table/"),
        moves=tensors["moves"].bool(),
        fixed=_under(tensors, "fixed/"),
    )


def _under(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {
        name.removeprefix(prefix): torch.as_tensor(value)
        for name, value in tensors.items()
        if name.startswith(prefix)
    }

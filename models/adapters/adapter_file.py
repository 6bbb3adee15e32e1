"""What a stage taught a video model beside its own weights: one small file in a folder.

    FOLDER/adapter.safetensors    low-rank corrections, and the layers that we add to a public model

Names are those of the network with its corrections. The network's own weights are not in the file,
so it is put on a model of the same sizes when that model is loaded.
"""

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor, nn

from diff4splat.errors import CheckpointError
from diff4splat.io.scene_files.tensor_file import (
    WEIGHT_DTYPES,
    TensorFile,
    read_tensors,
    write_tensors,
)
from diff4splat.models.adapters.lora import DOWN, add_lora, is_lora
from diff4splat.models.adapters.tuning import ADDED
from diff4splat.models.config.tuning import ADAPTER_FILE

MAX_LISTED = 3


def write_adapter(weights: Mapping[str, Tensor], folder: Path) -> Path:
    """Write what is trained beside the weights of a network; returns the file.

    Raises:
        OutputError: the folder cannot be written.
    """
    kept = {key: value.float() for key, value in weights.items() if _is_kept(key)}
    write_tensors(TensorFile(tensors=kept, metadata={}), folder / ADAPTER_FILE)
    return folder / ADAPTER_FILE


def put_adapter(network: nn.Module, folder: Path) -> None:
    """Add the corrections to a network and give its added layers their trained values, in place.

    Raises:
        CheckpointError: the file belongs to a network of other sizes, or holds NaN or infinity.
        FileFormatError: it is damaged.
    """
    file = folder / ADAPTER_FILE
    stored = read_tensors(file, WEIGHT_DTYPES)
    ranks = {value.shape[0] for key, value in stored.items() if key.endswith(DOWN) and value.ndim}
    if len(ranks) > 1 or not stored or not all(map(_is_kept, stored)):
        raise CheckpointError(f"{file}: expected an adapter of one rank, got other weights")
    shapes = {key: value.shape for key, value in network.state_dict().items()}
    _require_sizes(file, stored, shapes, corrected=bool(ranks))
    for rank in ranks:
        add_lora(network, rank)
    weights = network.state_dict()
    _refuse(file, [key for key in weights if is_lora(key) and key not in stored], "missing")
    _refuse(
        file,
        [key for key in stored if key not in weights or weights[key].shape != stored[key].shape],
        "unknown or of another shape",
    )
    with torch.no_grad():
        for key, value in stored.items():
            weights[key].copy_(value)


def _require_sizes(
    file: Path, stored: Mapping[str, Tensor], shapes: Mapping[str, torch.Size], *, corrected: bool
) -> None:
    """What can be seen before the network is changed."""
    for key, value in stored.items():
        if not bool(value.isfinite().all()):
            raise CheckpointError(f"{file}: expected finite numbers in {key}, got NaN or infinity")
    plain = [key for key in stored if not is_lora(key)]
    wrong = [key for key in plain if key not in shapes or shapes[key] != stored[key].shape]
    layers = [key.removesuffix(DOWN) for key in stored if key.endswith(DOWN)] if corrected else []
    for layer in layers:
        base, down = shapes.get(f"{layer}.weight"), stored[layer + DOWN].shape
        if base is None or len(down) != 2 or down[0] < 1 or down[1] != base[1]:
            wrong.append(layer + DOWN)
    _refuse(file, wrong, "unknown or of another shape")


def _refuse(file: Path, keys: list[str], what: str) -> None:
    if keys:
        listed = ", ".join(keys[:MAX_LISTED]) + (", …" if len(keys) > MAX_LISTED else "")
        raise CheckpointError(
            f"{file}: expected an adapter of this model, got {len(keys)} weights {what} "
            f"({listed}); name the model that it was trained on"
        )


def _is_kept(key: str) -> bool:
    return is_lora(key) or key.startswith(ADDED)

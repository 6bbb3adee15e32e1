"""Named tensors to a folder and back by torch.distributed.checkpoint, on any process count.

Storage is safetensors with the offset of every shard in its header. DCP's default storage keeps its
metadata as pickle, which runs code of whoever wrote the file; with this one, loading a checkpoint
from somebody else is as harmless as loading weights.
"""

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import torch
import torch.distributed.checkpoint as dcp
from torch import Tensor
from torch.distributed.checkpoint.api import CheckpointException

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.atomic import output_error
from diff4splat.io.require_file import require_file
from diff4splat.training.trainer.loop.optim import local

MOST_BYTES = 1 << 30
"""Tensors of one file together, roughly: a file is put together in memory before it is written."""
MAX_LISTED = 3


def write_tensors(folder: Path, tensors: Mapping[str, Tensor]) -> None:
    """Every process writes its shards.

    Raises:
        OutputError: at all processes when one of them could not write.
    """
    writer = dcp.HuggingFaceStorageWriter(
        str(folder), fqn_to_index_mapping=_file_numbers(tensors), save_distributed=True
    )
    try:
        with _alone_is_fine():
            dcp.save(_storable(tensors), storage_writer=writer)
    except CheckpointException as error:
        for cause, _ in error.failures.values():
            if isinstance(cause, OSError):
                raise output_error(folder, cause) from error
        raise


def read_tensors(folder: Path, tensors: Mapping[str, Tensor]) -> None:
    """Fill the tensors in place; what else is stored there is ignored.

    Raises:
        CheckpointError: a tensor is missing or has another shape.
        FileFormatError: a file is damaged.
    """
    _require_shapes(folder, stored_shapes(folder), tensors)
    reader = dcp.HuggingFaceStorageReader(str(folder))
    try:
        with _alone_is_fine():
            dcp.load(dict(tensors), storage_reader=reader)
    except (Exception, CheckpointException) as error:  # damage makes it raise almost anything
        raise FileFormatError(f"{folder}: expected whole shards, got damaged ones") from error


def stored_shapes(folder: Path) -> dict[str, tuple[int, ...]]:
    """Shape of every tensor in the folder.

    Raises:
        FileFormatError: a file is damaged.
    """
    files = sorted(folder.glob("*.safetensors"))
    for file in files:
        require_file(file, "tensors of a checkpoint")
    try:
        metadata = dcp.HuggingFaceStorageReader(str(folder)).read_metadata()
        shapes = {name: tuple(item.size) for name, item in metadata.state_dict_metadata.items()}
    except Exception as error:  # damaged headers make it raise almost anything
        raise FileFormatError(f"{folder}: expected whole shards, got damaged ones") from error
    # Headers may speak of tensors that nobody stored, for which no memory should be taken.
    if sum(math.prod(shape) for shape in shapes.values()) > sum(f.stat().st_size for f in files):
        raise FileFormatError(f"{folder}: expected shards of whole tensors, got parts of them")
    return shapes


def _storable(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Safetensors knows neither strides nor two names for one memory: those are copied."""
    found, seen = {}, set()
    for name, tensor in tensors.items():
        mine = local(tensor.detach())
        # Shards may be empty, and empty memory is nobody's.
        shared = mine.numel() > 0 and mine.data_ptr() in seen
        plain = mine.is_contiguous() and not shared
        found[name] = tensor if plain else tensor.clone(memory_format=torch.contiguous_format)
        seen.add(mine.data_ptr())
    return found


@contextmanager
def _alone_is_fine() -> Iterator[None]:
    """DCP warns with a single process, even when asked not to."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="torch.distributed is disabled", module="torch")
        yield


def _require_shapes(
    folder: Path, stored: Mapping[str, tuple[int, ...]], wanted: Mapping[str, Tensor]
) -> None:
    _refuse(folder, "missing", (name for name in wanted if name not in stored))
    _refuse(
        folder,
        "of another shape",
        (
            f"{name} {stored[name]} instead of {tuple(tensor.shape)}"
            for name, tensor in wanted.items()
            if stored[name] != tuple(tensor.shape)
        ),
    )


def _refuse(folder: Path, what: str, found: Iterable[str]) -> None:
    names = list(found)
    if names:
        listed = ", ".join(names[:MAX_LISTED]) + (", …" if len(names) > MAX_LISTED else "")
        raise CheckpointError(
            f"{folder}: expected every tensor of the stage, got {len(names)} {what} ({listed}); "
            "the checkpoint belongs to another configuration"
        )


def _file_numbers(tensors: Mapping[str, Tensor]) -> dict[str, int]:
    """File number of each tensor, from 1."""
    numbers, bytes_before = {}, 0
    for name, tensor in tensors.items():
        numbers[name] = 1 + bytes_before // MOST_BYTES
        bytes_before += tensor.numel() * tensor.element_size()
    used = {number: index for index, number in enumerate(sorted(set(numbers.values())), start=1)}
    return {name: used[number] for name, number in numbers.items()}

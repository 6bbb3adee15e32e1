"""Tensors of several files as one ``.safetensors`` file under other names, byte by byte.

No tensor is ever in memory as a whole: bytes are copied in pieces, and neither their values nor
their type change.
"""

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.atomic import atomic_path
from diff4splat.models.public_weights.shard_files import StoredTensor

PIECE_BYTES = 16 << 20
MAX_LISTED = 8
"""Names in a message before "…"."""

Shapes = Mapping[str, tuple[int, ...]]


def match_keys(
    stored: Mapping[str, StoredTensor],
    wanted: Shapes,
    rename: Callable[[str], str | None],
    what: str,
) -> dict[str, StoredTensor]:
    """Stored tensors under the names that are wanted; ``rename`` returns None for what is ignored.

    Shapes may differ by axes that are joined or of size one.

    Raises:
        CheckpointError: names are unknown or missing, all listed, or a shape is another.
    """
    renamed = {key: rename(key) for key in stored}
    named = {new: stored[key] for key, new in renamed.items() if new is not None}
    unknown = [key for key, new in renamed.items() if new is not None and new not in wanted]
    _refuse(unknown, f"{what}: unknown")
    _refuse([key for key in wanted if key not in named], f"{what}: missing")
    wrong = [
        f"{key} {named[key].shape} instead of {tuple(wanted[key])}"
        for key in wanted
        if not _same_order(named[key].shape, wanted[key])
    ]
    _refuse(wrong, f"{what}: wrong shape of")
    return named


def write_merged(
    stored: Mapping[str, StoredTensor],
    fresh: Mapping[str, Tensor],
    shapes: Shapes,
    file: Path,
    advance: Callable[[int], None] = lambda count: None,
) -> None:
    """Write ``stored`` tensors in the wanted shapes, and ``fresh`` ones in float32.

    ``advance`` gets the bytes that each piece had.

    Raises:
        FileFormatError: a file changed while it was read.
        OutputError: the folder cannot be written.
    """
    header, end = {}, 0
    for name, tensor in stored.items():
        header[name] = _entry(tensor.dtype, shapes[name], end, tensor.size)
        end += tensor.size
    for name, value in fresh.items():
        header[name] = _entry("F32", value.shape, end, 4 * value.numel())
        end += 4 * value.numel()
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with atomic_path(file) as temporary, temporary.open("wb") as out:
        out.write(len(text).to_bytes(8, "little") + text)
        for tensor in stored.values():
            _copy(tensor, out, advance)
        for value in fresh.values():
            out.write(value.detach().to(torch.float32).contiguous().numpy().tobytes())


def _entry(dtype: str, shape: tuple[int, ...], start: int, size: int) -> dict[str, object]:
    return {"dtype": dtype, "shape": list(shape), "data_offsets": [start, start + size]}


def _copy(tensor: StoredTensor, out: BinaryIO, advance: Callable[[int], None]) -> None:
    with tensor.file.open("rb") as source:
        source.seek(tensor.start)
        left = tensor.size
        while left:
            piece = source.read(min(left, PIECE_BYTES))
            if not piece:
                raise FileFormatError(f"{tensor.file}: expected more bytes; download it again")
            out.write(piece)
            left -= len(piece)
            advance(len(piece))


def _same_order(shape: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    """Whether the numbers lie in the same order: the first axis that is not 1 must agree."""
    first, second = ([side for side in each if side != 1] for each in (shape, wanted))
    return math.prod(first) == math.prod(second) and first[:1] == second[:1]


def _refuse(names: list[str], what: str) -> None:
    if names:
        listed = ", ".join(names[:MAX_LISTED]) + (", …" if len(names) > MAX_LISTED else "")
        raise CheckpointError(
            f"{what} {len(names)} ({listed}); these weights are of another architecture"
        )

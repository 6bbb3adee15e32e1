"""Named tensors and text in one ``.safetensors`` file; equal content gives equal bytes.

Layout: the header length (8 bytes, little-endian), a JSON header padded with spaces to a multiple
of 8, then the tensors back to back (https://github.com/huggingface/safetensors, "Format").
Written here because the library's writer orders metadata at random and lets only the owner read
the result; read through the library.
"""

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.require_file import require_file

_TYPE_NAMES = {
    torch.float64: "F64",
    torch.int64: "I64",
    torch.float32: "F32",
    torch.uint8: "U8",
}
STORED_DTYPES = tuple(_TYPE_NAMES.values())
"""What ``write_tensors`` writes, by the names of the format."""
WEIGHT_DTYPES = ("F64", "F32", "F16", "BF16", "I64", "U8")
"""What weights of networks may be stored in."""
MAX_AXES = 16
"""Far above any tensor of ours; numpy and torch have limits of their own."""
MAX_HEADER_BYTES = 100_000_000
"""The library's own limit; real headers have a few kilobytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TensorFile:
    """What such a file holds."""

    tensors: dict[str, Tensor]
    """float32, float64, int64 or uint8."""
    metadata: dict[str, str]


def write_tensors(content: TensorFile, file: Path) -> None:
    """Write whole or not at all, in an order that depends on nothing but names and types.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    tensors = {name: value.detach().cpu().contiguous() for name, value in content.tensors.items()}
    # Wide types first keeps every tensor aligned to its own size.
    order = sorted(tensors, key=lambda name: (-tensors[name].element_size(), name))
    with atomic_path(file) as temporary, temporary.open("wb") as stream:
        stream.write(_header(tensors, order, content.metadata))
        for name in order:
            stream.write(tensors[name].numpy().data)


def _header(tensors: dict[str, Tensor], order: list[str], metadata: dict[str, str]) -> bytes:
    entries: dict[str, object] = {"__metadata__": dict(sorted(metadata.items()))}
    end = 0
    for name in order:
        start, end = end, end + tensors[name].nbytes
        kind, shape = _TYPE_NAMES[tensors[name].dtype], list(tensors[name].shape)
        entries[name] = {"dtype": kind, "shape": shape, "data_offsets": [start, end]}
    text = json.dumps(entries, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text


def read_metadata(file: Path) -> dict[str, str]:
    """The text part alone; tensors are not read.

    Raises:
        FileFormatError: the file is damaged, cut off or of another kind.
    """
    with opened_tensors(file) as opened:
        return opened.metadata() or {}


def read_tensors(file: Path, dtypes: Collection[str] = STORED_DTYPES) -> dict[str, Tensor]:
    """Every tensor, copied into memory so that the file may change afterwards.

    Raises:
        FileFormatError: the file is damaged, cut off or of another kind, or holds a tensor of a
            dtype that is not among ``dtypes`` (names of the format).
    """
    with opened_tensors(file) as opened:
        names = sorted(opened.keys())
        for name in names:
            entry = opened.get_slice(name)
            found, axes = entry.get_dtype(), len(entry.get_shape())
            if axes > MAX_AXES:
                raise FileFormatError(
                    f"{name[:60]}: expected at most {MAX_AXES} axes, got {axes}; copy it again"
                )
            if found not in dtypes:
                raise FileFormatError(
                    f"{name[:60]}: expected one of {', '.join(dtypes)}, got {found}; the file was "
                    "not written by diff4splat, or is damaged"
                )
        return {name: opened.get_tensor(name).clone() for name in names}


@contextmanager
def opened_tensors(file: Path) -> Iterator[safe_open]:
    """The file, open for reading one tensor at a time.

    Raises:
        FileFormatError: the file is damaged, cut off or of another kind.
    """
    require_file(file, "a .safetensors file")
    try:
        with safe_open(file, "pt") as opened:
            yield opened
    except FileFormatError:
        raise
    # Shapes that no tensor can have end in errors of the library and of torch.
    except (SafetensorError, OSError, RuntimeError, ValueError, TypeError, OverflowError) as error:
        raise FileFormatError(_diagnose(file)) from error


def _diagnose(file: Path) -> str:
    """Say in words why the library refused ``file``."""
    with file.open("rb") as stream:
        start = stream.read(9)
    length, size = int.from_bytes(start[:8], "little"), file.stat().st_size
    if len(start) == 9 and start[8:] != b"{":
        return "expected a .safetensors file, got another kind of file; check the path"
    if length > MAX_HEADER_BYTES:
        return f"expected a header of at most {MAX_HEADER_BYTES} bytes, got {length}; copy it again"
    if len(start) < 9 or 8 + length > size:
        return f"expected a whole file, got only the first {size} bytes; copy it again"
    return "expected a whole .safetensors file, got a cut off or damaged one; copy it again"

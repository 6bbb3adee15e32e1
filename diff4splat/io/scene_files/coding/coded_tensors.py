"""Tensors of a scene file in coded form, and back: ``NAME.low``, ``NAME.step``, ``NAME.planes``.

An entry of the metadata says how a tensor was coded. Entries come from outside: each is checked
before memory is taken for it.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.coding.rows import (
    BLOCK_ROWS,
    MAX_PLANES,
    CodedRows,
    decode_rows,
    encode_rows,
)
from diff4splat.io.scene_files.coding.transforms import TRANSFORMS
from diff4splat.io.scene_files.tensor_checks import take_floats, take_value

DTYPES = {"F32": torch.float32, "F64": torch.float64, "I64": torch.int64}
PARTS = ("low", "step", "planes")
HEADER_BYTES = 400
"""What an entry and three more tensors take in the header of a file."""
ALWAYS_ALLOWED_BYTES = 64 * 2**20
MAX_GROWTH = 256
"""Larger tensors may take up to so many bytes for each byte of the file."""
_LARGEST_WHOLE = 2.0**53


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How one tensor is to be coded."""

    steps: Float[np.ndarray, "r s"]
    """For every row or for all (r = 1), for every column or for all (s = 1)."""
    columns: int
    transform: str = "value"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """How one tensor was coded, as the metadata hold it."""

    transform: str
    dtype: str
    shape: list[int]
    columns: int
    block_rows: int
    planes: int

    @property
    def rows(self) -> int:
        """Of the table that the tensor was reshaped to."""
        return math.prod(self.shape) // self.columns

    @property
    def nbytes(self) -> int:
        """Of the tensor in memory."""
        return math.prod(self.shape) * DTYPES[self.dtype].itemsize


def encode_tensor(tensor: Tensor, plan: Plan) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """The parts and the entry of a tensor; None if it does not get smaller, or cannot be coded."""
    values = tensor.detach().cpu().double().numpy().reshape(-1, plan.columns)
    coded = encode_rows(TRANSFORMS[plan.transform].encode(values), plan.steps)
    if coded is None:
        return None
    data = np.frombuffer(coded.data, np.uint8).copy()
    arrays = {"low": coded.low, "step": coded.step, "planes": data}
    if HEADER_BYTES + sum(array.nbytes for array in arrays.values()) >= tensor.nbytes:
        return None
    entry = Entry(
        transform=plan.transform,
        dtype=next(name for name, dtype in DTYPES.items() if dtype == tensor.dtype),
        shape=list(tensor.shape),
        columns=plan.columns,
        block_rows=BLOCK_ROWS,
        planes=coded.planes,
    )
    return {part: torch.from_numpy(array) for part, array in arrays.items()}, asdict(entry)


def decode_tensors(
    stored: Mapping[str, Tensor], entries: Mapping[str, Any], file_bytes: int
) -> dict[str, Tensor]:
    """All tensors of a file of ``file_bytes``, the coded ones in their own shape and dtype.

    Raises:
        FileFormatError: an entry, or one of its tensors, is missing, damaged, unknown or too large.
    """
    checked = {name: _take_entry(entries, name) for name in entries}
    _require_size(checked, file_bytes)
    tensors = dict(stored)
    for name, entry in checked.items():
        if name in stored:
            raise FileFormatError(f"{name[:60]}: expected one tensor, got a plain and a coded one")
        tensors[name] = _decode(stored, name, entry)
        for part in PARTS:
            tensors.pop(f"{name}.{part}", None)
    return tensors


def _require_size(entries: Mapping[str, Entry], file_bytes: int) -> None:
    needed = sum(entry.nbytes for entry in entries.values())
    if needed > max(ALWAYS_ALLOWED_BYTES, MAX_GROWTH * file_bytes):
        raise FileFormatError(
            f"coded tensors: expected at most {MAX_GROWTH} times the {file_bytes} bytes of the "
            f"file, got {needed} bytes; the file is damaged or was made to fill the memory"
        )


def _take_entry(entries: Mapping[str, Any], name: str) -> Entry:
    where = f"metadata 'encodings', {name[:60]!r}"
    found = take_value(entries, name, dict)
    transform, dtype = take_value(found, "transform", str), take_value(found, "dtype", str)
    for kind, value, known in (("transform", transform, TRANSFORMS), ("dtype", dtype, DTYPES)):
        if value not in known:
            raise FileFormatError(
                f"{where}: expected {kind} {', '.join(known)}, got {value[:40]!r}; update "
                "diff4splat, or copy the file again"
            )
    shape = _take_shape(found, where)
    numbers = {}
    for key, least, most in (
        ("columns", 1, 2**20),
        ("block_rows", 1, 2**31),
        ("planes", 0, MAX_PLANES),
    ):
        numbers[key] = take_value(found, key, int | None)
        if numbers[key] is None or not least <= numbers[key] <= most:
            raise FileFormatError(
                f"{where}: expected {key} from {least} to {most}, got {str(numbers[key])[:40]}"
            )
    if math.prod(shape) % numbers["columns"]:
        raise FileFormatError(f"{where}: expected columns that divide the shape {shape}")
    if transform == "smallest_three" and numbers["columns"] != 4:
        raise FileFormatError(f"{where}: expected 4 columns for quaternions")
    return Entry(transform=transform, dtype=dtype, shape=shape, **numbers)


def _take_shape(found: Mapping[str, Any], where: str) -> list[int]:
    shape = take_value(found, "shape", list)
    whole = all(isinstance(size, int) and not isinstance(size, bool) for size in shape)
    if not (1 <= len(shape) <= 4 and whole and all(0 < size < 2**40 for size in shape)):
        raise FileFormatError(
            f"{where}: expected a shape of 1 to 4 numbers above 0, got {repr(shape)[:60]}"
        )
    return shape


def _decode(stored: Mapping[str, Tensor], name: str, entry: Entry) -> Tensor:
    try:
        table = decode_rows(_take_rows(stored, name, entry), entry.rows, entry.block_rows)
        values = TRANSFORMS[entry.transform].decode(table).reshape(entry.shape)
    except ValueError as error:
        raise FileFormatError(f"{name[:60]}: {error}; copy the file again") from error
    if entry.dtype == "I64" and not (np.abs(values) < _LARGEST_WHOLE).all():
        raise FileFormatError(f"{name[:60]}: expected whole numbers, got one that is too large")
    return torch.from_numpy(values).to(DTYPES[entry.dtype])


def _take_rows(stored: Mapping[str, Tensor], name: str, entry: Entry) -> CodedRows:
    blocks = -(-entry.rows // entry.block_rows)
    low = take_floats(stored, f"{name}.low", (blocks, entry.columns))
    step = take_floats(stored, f"{name}.step", (blocks, None))
    if step.shape[1] not in (1, entry.columns):
        raise FileFormatError(
            f"{name[:60]}.step: expected 1 or {entry.columns} columns, got {step.shape[1]}"
        )
    data = take_bytes(stored, f"{name}.planes")
    return CodedRows(
        low=low.double().numpy(), step=step.double().numpy(), data=data, planes=entry.planes
    )


def take_bytes(tensors: Mapping[str, Tensor], name: str) -> bytes:
    """The bytes of the uint8 tensor called ``name``.

    Raises:
        FileFormatError: it is missing, or of another shape or type.
    """
    value = tensors.get(name)
    if value is None or value.dtype != torch.uint8 or value.ndim != 1:
        got = "nothing" if value is None else f"{str(value.dtype)[6:]} {tuple(value.shape)}"
        raise FileFormatError(f"{name[:60]}: expected a row of bytes, got {got}")
    return value.numpy().tobytes()

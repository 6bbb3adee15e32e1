"""A table of numbers as whole multiples of a step, in compressed bytes.

Axes: ``r`` rows, ``c`` columns, ``b`` blocks of ``BLOCK_ROWS`` rows. Within a block

    value = low + step · q,  q = 0, 1, 2 …

``q`` is split into bytes, the lowest first. All lowest bytes come before all next ones; each column
is stored as differences from row to row, modulo 256, because neighbours are alike. Then DEFLATE.
"""

import zlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8, UInt32

BLOCK_ROWS = 1024
MAX_PLANES = 4
"""Bytes of one ``q``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedRows:
    """A table as a file stores it."""

    low: Float[np.ndarray, "b c"]
    """The least value of each column of a block."""
    step: Float[np.ndarray, "b #c"]
    """One for all columns, or one for each."""
    data: bytes
    """Planes of bytes, compressed (zlib, RFC 1950)."""
    planes: int


def encode_rows(
    values: Float[np.ndarray, "r c"], steps: Float[np.ndarray, "#r #c"]
) -> CodedRows | None:
    """The table with errors of at most half the least step of each block.

    ``steps`` are what each row, or each number, may be rounded to. None if there is no row, a value
    is not finite, or a block spans more than 2³² steps.
    """
    if not len(values) or not np.isfinite(values).all():
        return None
    starts = np.arange(0, len(values), BLOCK_ROWS)
    low = np.minimum.reduceat(values, starts)
    step = np.minimum.reduceat(np.broadcast_to(steps, (len(values), steps.shape[1])), starts)
    q = _multiples(values, low, step)
    if q is None:
        return None
    planes = (int(q.max(initial=0)).bit_length() + 7) // 8
    return CodedRows(low=low, step=step, data=_compress(q, planes), planes=planes)


def _multiples(
    values: Float[np.ndarray, "r c"], low: Float[np.ndarray, "b c"], step: Float[np.ndarray, "b #c"]
) -> UInt32[np.ndarray, "c r"] | None:
    """Whole numbers of steps, column by column; None if one does not fit."""
    block = np.arange(len(values)) // BLOCK_ROWS
    multiples = np.empty(values.T.shape, np.uint32)
    steps = np.broadcast_to(step, low.shape)
    for column, row in enumerate(multiples):
        with np.errstate(all="ignore"):
            q = np.rint((values[:, column] - low[block, column]) / steps[block, column])
        if not q.max() < 256.0**MAX_PLANES:
            return None
        row[:] = q
    return multiples


def decode_rows(coded: CodedRows, rows: int, block_rows: int) -> Float[np.ndarray, "r c"]:
    """The table.

    Raises:
        ValueError: the bytes are damaged, or not as many as the table needs.
    """
    columns = coded.low.shape[1]
    parts = _decompress(coded.data, coded.planes * columns * rows)
    parts = parts.reshape(coded.planes, columns, rows)
    steps = np.broadcast_to(coded.step, coded.low.shape)
    block = np.arange(rows) // block_rows
    values = np.empty((rows, columns))
    for column in range(columns):
        q = np.zeros(rows)
        for place, part in enumerate(parts[:, column]):
            q += np.cumsum(part, dtype=np.uint8) * 256.0**place
        with np.errstate(all="ignore"):
            values[:, column] = coded.low[block, column] + steps[block, column] * q
    return values


def _compress(q: UInt32[np.ndarray, "c r"], planes: int) -> bytes:
    parts = [(q >> np.uint32(8 * place)).astype(np.uint8) for place in range(planes)]
    changes = [np.diff(part, axis=1, prepend=np.uint8(0)).tobytes() for part in parts]
    return zlib.compress(b"".join(changes), 6)


def _decompress(data: bytes, size: int) -> UInt8[np.ndarray, " n"]:
    """Exactly ``size`` bytes; no more are ever unpacked."""
    unpacker = zlib.decompressobj()
    try:
        content = unpacker.decompress(data, size + 1)
    except zlib.error as error:
        raise ValueError(f"damaged bytes ({error})") from error
    if len(content) != size or not unpacker.eof or unpacker.unused_data:
        raise ValueError(f"expected {size} bytes, got {'more' if len(content) >= size else 'less'}")
    return np.frombuffer(content, np.uint8)

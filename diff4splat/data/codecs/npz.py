"""NumPy archives: equal arrays give equal bytes, and nothing is read before its header is checked.

Plain ``.npz`` that ``numpy.load`` opens. Truth values are packed eight to a byte, first one in the
highest bit (``numpy.packbits``), over the flattened array.
"""

import io
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from jaxtyping import Bool

from diff4splat.errors import FileFormatError
from diff4splat.io.npy_header import START_BYTES, read_npy_header

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The first time that ZIP knows; real ones would make equal clips differ."""
_LEVEL = 1
"""Deflate; higher levels save a hundredth of the size and take half as long again."""


def encode_npz(arrays: Mapping[str, np.ndarray], packed: bool = True) -> bytes:
    """An archive in the order given, deflated or as it is."""
    written, kind = io.BytesIO(), zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(written, "w", kind, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            plain = io.BytesIO()
            little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
            np.lib.format.write_array(plain, little, version=(1, 0), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            entry.compress_type, entry.external_attr = kind, 0o644 << 16
            archive.writestr(entry, plain.getvalue())
    return written.getvalue()


@contextmanager
def opened_npz(content: bytes) -> Iterator[zipfile.ZipFile]:
    """The archive, for ``take_array``.

    Raises:
        FileFormatError: it is no archive.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except Exception as error:  # damaged archives make the reader raise almost anything
        raise FileFormatError("expected a NumPy archive, got a damaged or other file") from error
    with archive:
        yield archive


def has_array(archive: zipfile.ZipFile, name: str) -> bool:
    """Whether the archive names this array."""
    return f"{name}.npy" in archive.namelist()


def take_array(
    archive: zipfile.ZipFile, name: str, dtype: type[np.generic], shape: tuple[int, ...]
) -> np.ndarray:
    """The array called ``name``; no more is unpacked than it should hold.

    Raises:
        FileFormatError: missing, damaged, of another type or shape, or of another length.
    """
    want = math.prod(shape) * np.dtype(dtype).itemsize
    try:
        with archive.open(f"{name}.npy") as stream:
            # One byte too many shows a longer array; what claims to be huge is never unpacked.
            content = stream.read(START_BYTES + want + 1)
    except KeyError as error:
        raise FileFormatError(f"expected the array '{name}', got an archive without it") from error
    except Exception as error:  # as above
        raise FileFormatError(f"expected a whole array '{name}', got a damaged one") from error
    try:
        header = read_npy_header(content[:START_BYTES])
    except FileFormatError as error:
        raise FileFormatError(f"'{name}': {error}") from error
    if (header.shape, header.dtype, header.by_columns) != (shape, np.dtype(dtype), False):
        raise FileFormatError(
            f"'{name}': expected {np.dtype(dtype)} of shape {shape}, got {header.dtype} of shape "
            f"{header.shape}"
        )
    if len(content) - header.data_start != want:
        raise FileFormatError(f"expected a whole array '{name}', got a damaged one")
    return np.frombuffer(bytearray(memoryview(content)[header.data_start :]), dtype).reshape(shape)


def pack(values: Bool[np.ndarray, "..."]) -> np.ndarray:
    """Eight truth values to a byte."""
    return np.packbits(values.reshape(-1))


def take_bits(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """The truth values that ``pack`` packed.

    Raises:
        FileFormatError: as ``take_array``.
    """
    count = math.prod(shape)
    packed = take_array(archive, name, np.uint8, (-(-count // 8),))
    return np.unpackbits(packed, count=count).astype(bool).reshape(shape)

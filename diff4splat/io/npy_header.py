"""Headers of NumPy arrays, read by hand: NumPy's own parser evaluates whatever text stands there.

Layout: a magic word, version, length, then a dictionary with ``descr``, ``fortran_order`` and
``shape`` as text (numpy.lib.format). Numbers and truth values alone, of any byte order.
"""

import math
import re
from dataclasses import dataclass

import numpy as np

from diff4splat.errors import FileFormatError

START_BYTES = 1 << 16
"""No honest header is longer; so many bytes of a file are enough to read it."""
_MAGIC = b"\x93NUMPY"
_ENTRIES = {
    "descr": re.compile(r"""['"]descr['"]\s*:\s*['"]([<>=|]?[fiub]\d{1,2})['"]"""),
    "order": re.compile(r"""['"]fortran_order['"]\s*:\s*(True|False)"""),
    "shape": re.compile(r"""['"]shape['"]\s*:\s*\(([0-9, ]{0,200})\)"""),
}
_MAX_DIMENSIONS, _MAX_BYTES = 16, 1 << 48


@dataclass(frozen=True, slots=True, kw_only=True)
class NpyHeader:
    """What the array is, and where its values begin."""

    shape: tuple[int, ...]
    dtype: np.dtype
    by_columns: bool
    """First index fastest."""
    data_start: int
    """Bytes before the values."""

    @property
    def data_bytes(self) -> int:
        """Length of the values."""
        return math.prod(self.shape) * self.dtype.itemsize


def read_npy_header(start: bytes) -> NpyHeader:
    """The header at the ``start`` of a file.

    Raises:
        FileFormatError: no array, or one of other things than numbers; without the file's name.
    """
    text, data_start = _text(start)
    found = {name: pattern.search(text) for name, pattern in _ENTRIES.items()}
    rest = text
    for match in filter(None, found.values()):
        rest = rest.replace(match[0], "", 1)
    if None in found.values() or re.fullmatch(r"\{[\s,]*\}\s*", rest) is None:
        raise FileFormatError(f"expected the header of an array of numbers, got {text[:60]!r}")
    try:
        dtype = np.dtype(found["descr"][1])
    except TypeError:
        raise FileFormatError(f"expected numbers, got {found['descr'][1]!r}") from None
    shape = tuple(int(side) for side in found["shape"][1].replace(",", " ").split())
    header = NpyHeader(
        shape=shape,
        dtype=dtype,
        by_columns=found["order"][1] == "True",
        data_start=data_start,
    )
    if len(shape) > _MAX_DIMENSIONS or max(shape, default=0) > _MAX_BYTES:
        raise FileFormatError(f"expected an array that fits into memory, got {str(shape)[:60]}")
    return header


def _text(start: bytes) -> tuple[str, int]:
    """The header's text, and its end in the file."""
    if not start.startswith(_MAGIC) or len(start) < 12:
        raise FileFormatError("expected a NumPy array, got other data")
    wide = 4 if start[6] > 1 else 2
    end = 8 + wide + int.from_bytes(start[8 : 8 + wide], "little")
    if start[6] not in (1, 2, 3) or end > min(len(start), START_BYTES):
        raise FileFormatError("expected a whole NumPy array, got a damaged or cut off header")
    return start[8 + wide : end].decode("latin-1"), end

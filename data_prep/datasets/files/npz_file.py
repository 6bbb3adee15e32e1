"""Arrays of NumPy archives by other programs: numbers alone, of a size that the file can hold."""

import zipfile
from pathlib import Path

import numpy as np

from diff4splat.errors import FileFormatError
from diff4splat.io.npy_header import START_BYTES, read_npy_header
from diff4splat.io.require_file import require_file

_MOST_BYTES = 8 << 30
_MOST_PER_BYTE = 1032
"""Deflate packs no more bytes into one."""


class NpzFile:
    """One archive; every array is read when asked for."""

    def __init__(self, file: Path) -> None:
        """Look at the list of arrays.

        Raises:
            FileFormatError: missing, or no whole archive.
        """
        require_file(file, "a NumPy archive")
        self.file = file
        try:
            with zipfile.ZipFile(file) as archive:
                self._sizes = {e.filename: e.compress_size for e in archive.infolist()}
        except Exception as error:  # damaged archives make the reader raise almost anything
            raise self._damaged("a NumPy archive") from error

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._sizes

    def shape(self, name: str) -> tuple[int, ...]:
        """The shape of an array, without its values."""
        return self._header(name)[0].shape

    def array(self, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """The array ``name`` of ``shape``, in which None is any length.

        Raises:
            FileFormatError: missing, damaged, of another shape, or of things that are no numbers.
        """
        header, start = self._header(name)
        fits = len(header.shape) == len(shape) and all(
            want in (None, got) for want, got in zip(shape, header.shape, strict=True)
        )
        if not fits:
            want = tuple("any" if side is None else side for side in shape)
            raise FileFormatError(
                f"{self.file}: expected '{name}' of shape {want}, got {header.shape}; it is of "
                "another version or was converted"
            )
        limit = min(_MOST_BYTES, _MOST_PER_BYTE * self._sizes[f"{name}.npy"] + START_BYTES)
        if header.data_bytes > limit:
            raise FileFormatError(
                f"{self.file}: expected '{name}' of a size that the file can hold, got "
                f"{header.data_bytes:,} bytes; it is damaged"
            )
        content = self._read(name, header.data_start + header.data_bytes + 1)
        if len(content) != header.data_start + header.data_bytes or start != content[: len(start)]:
            raise self._damaged(f"a whole array '{name}'")
        order = "F" if header.by_columns else "C"
        values = np.frombuffer(bytearray(content[header.data_start :]), header.dtype)
        return values.reshape(header.shape, order=order)

    def _header(self, name: str):
        if name not in self:
            known = ", ".join(sorted(key.removesuffix(".npy") for key in self._sizes)) or "nothing"
            raise FileFormatError(
                f"{self.file}: expected the array '{name}', got {known[:120]}; it is of another "
                "version of the data set"
            )
        start = self._read(name, START_BYTES)
        try:
            return read_npy_header(start), start
        except FileFormatError as error:
            raise FileFormatError(
                f"{self.file}, '{name}': {error}; arrays of objects would run code and are not read"
            ) from None

    def _read(self, name: str, most: int) -> bytes:
        try:
            with zipfile.ZipFile(self.file) as archive, archive.open(f"{name}.npy") as stream:
                return stream.read(most)
        except Exception as error:  # as above
            raise self._damaged(f"a whole array '{name}'") from error

    def _damaged(self, what: str) -> FileFormatError:
        return FileFormatError(
            f"{self.file}: expected {what}, got a cut off or damaged one; copy it again"
        )

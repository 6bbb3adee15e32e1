"""Floating-point images and depth in OpenEXR and NumPy files; axes ``h w c``."""

import io
from contextlib import redirect_stdout
from pathlib import Path
from threading import Lock

import numpy as np
import OpenEXR

from diff4splat.errors import FileFormatError
from diff4splat.io.exr_header import exr_sizes
from diff4splat.io.npy_header import START_BYTES, read_npy_header
from diff4splat.io.require_file import require_file
from diff4splat.io.silence_stderr import silence_native_stderr

FLOAT_SUFFIXES = (".exr", ".npy")

_PRINTING = Lock()


def npy_array(file: Path) -> np.ndarray:
    """The array of a NumPy file, memory mapped.

    Raises:
        FileFormatError: missing, damaged, cut off, or not of numbers.
    """
    require_file(file, "a NumPy file")
    try:
        with file.open("rb") as stream:
            header = read_npy_header(stream.read(START_BYTES))
        size = file.stat().st_size
    except (FileFormatError, OSError) as error:
        raise FileFormatError(f"{file}: {error}; copy it again") from error
    if header.dtype.kind not in "fiu":
        raise FileFormatError(f"{file}: expected a NumPy array of numbers, got another kind")
    if header.data_start + header.data_bytes > size:
        raise FileFormatError(
            f"{file}: expected a whole NumPy file, {header.data_bytes} bytes of values, got one of "
            f"{size} bytes; it is cut off or damaged, copy it again"
        )
    order = "F" if header.by_columns else "C"
    if not header.data_bytes:
        return np.empty(header.shape, header.dtype, order)
    return np.memmap(file, header.dtype, "r", header.data_start, header.shape, order)


def exr_size(file: Path) -> tuple[int, int]:
    """(height, width) from the header.

    Raises:
        FileFormatError: as ``exr_channels``.
    """
    require_file(file, "an OpenEXR file")
    with _PRINTING, silence_native_stderr(), redirect_stdout(io.StringIO()):
        try:
            return exr_sizes(file)[0]
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}; copy it again") from error


def exr_channels(file: Path) -> dict[str, np.ndarray]:
    """Every channel of the first part by name, each ``h w``.

    Raises:
        FileFormatError: missing, damaged, cut off, or not OpenEXR.
    """
    exr_size(file)
    part = _opened(file).parts[0]
    channels = {name: channel.pixels for name, channel in part.channels.items()}
    if not channels or any(pixels is None for pixels in channels.values()):
        raise _damaged(file)
    return channels


def _opened(file: Path) -> OpenEXR.File:
    said = io.StringIO()
    try:
        # The library reports damaged pixels by printing alone, and two threads that catch what is
        # printed would take it from each other.
        with _PRINTING, silence_native_stderr(), redirect_stdout(said):
            opened = OpenEXR.File(str(file), separate_channels=True)
    except Exception as error:  # damaged data makes the library raise almost anything
        raise _damaged(file) from error
    if said.getvalue() or not opened.parts:
        raise _damaged(file)
    return opened


def _damaged(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected a whole OpenEXR file, got a damaged or other one; copy it again"
    )

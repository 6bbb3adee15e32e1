"""Floating-point images and depth in OpenEXR and NumPy files; axes ``h w c``."""

import io
from contextlib import redirect_stdout
from pathlib import Path
from threading import Lock

import numpy as np
import OpenEXR

from diff4splat.errors import FileFormatError
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
        array = np.load(file, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise FileFormatError(
            f"{file}: expected a whole NumPy file of numbers, got another or a damaged one; "
            "copy it again"
        ) from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise FileFormatError(f"{file}: expected a NumPy array of numbers, got another kind")
    return array


def exr_size(file: Path) -> tuple[int, int]:
    """(height, width) from the header.

    Raises:
        FileFormatError: as ``exr_channels``.
    """
    header = _opened(file, header_only=True).parts[0].header
    (left, top), (right, bottom) = header["dataWindow"]
    return int(bottom - top + 1), int(right - left + 1)


def exr_channels(file: Path) -> dict[str, np.ndarray]:
    """Every channel of the first part by name, each ``h w``.

    Raises:
        FileFormatError: missing, damaged, cut off, or not OpenEXR.
    """
    part = _opened(file, header_only=False).parts[0]
    channels = {name: channel.pixels for name, channel in part.channels.items()}
    if not channels or any(pixels is None for pixels in channels.values()):
        raise _damaged(file)
    return channels


def _opened(file: Path, header_only: bool) -> OpenEXR.File:
    require_file(file, "an OpenEXR file")
    said = io.StringIO()
    try:
        # The library tells of damaged pixels by printing alone, and two threads that catch what is
        # printed would take it from each other.
        with _PRINTING, silence_native_stderr(), redirect_stdout(said):
            opened = OpenEXR.File(str(file), separate_channels=True, header_only=header_only)
    except (RuntimeError, ValueError, TypeError, MemoryError) as error:
        raise _damaged(file) from error
    if said.getvalue() or not opened.parts:
        raise _damaged(file)
    return opened


def _damaged(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected a whole OpenEXR file, got a damaged or other one; copy it again"
    )

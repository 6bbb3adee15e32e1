"""One array of an HDF5 file; the only file that imports h5py."""

from pathlib import Path

import numpy as np

from diff4splat.errors import FileFormatError, MissingExtraError
from diff4splat.io.require_file import require_file

_MOST_VALUES = 1 << 28


def hdf5_array(file: Path, key: str, dimensions: int) -> np.ndarray:
    """The array of numbers under ``key``.

    Raises:
        FileFormatError: missing, damaged, without the key, enormous, or of another kind.
        MissingExtraError: h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError(
            "HDF5 files: expected h5py, got an installation without it; "
            "pip install 'diff4splat[datasets]'"
        ) from error
    require_file(file, "an HDF5 file")
    try:
        with h5py.File(file, "r") as opened:
            found = opened.get(key)
            if not isinstance(found, h5py.Dataset) or found.dtype.kind not in "fiu":
                keys = ", ".join(list(opened)[:5]) or "nothing"
                raise FileFormatError(f"{file}: expected numbers under '{key}', got {keys[:80]}")
            if found.ndim != dimensions or not 0 < found.size <= _MOST_VALUES:
                raise FileFormatError(
                    f"{file}: expected '{key}' of {dimensions} dimensions, got shape {found.shape}"
                )
            if found.external or found.is_virtual:
                raise FileFormatError(f"{file}: expected '{key}' in the file, got a link elsewhere")
            return found[()]
    except FileFormatError:
        raise
    except Exception as error:  # damaged files make the library raise almost anything
        raise FileFormatError(
            f"{file}: expected a whole HDF5 file, got a cut off or damaged one; copy it again"
        ) from error

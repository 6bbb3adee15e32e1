"""Point clouds from PLY files and NumPy arrays.

Axes: ``p`` points. Non-finite points are dropped; an empty cloud is None.
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from diff4splat.data.capture.capture import PointCloud
from diff4splat.data_prep.readers.files.float_files import npy_array
from diff4splat.errors import FileFormatError
from diff4splat.io.ply.ply_body import Columns, read_columns
from diff4splat.io.ply.ply_header import read_header
from diff4splat.io.require_file import read_bytes

DEFAULT_GREY = 0.5
"""For points without colours."""
_LARGEST = float(np.finfo(np.float32).max)

CloudWithNotes = tuple[PointCloud | None, tuple[str, ...]]
"""The cloud and notes about it."""


def cloud_from_arrays(
    positions: Float[np.ndarray, "p 3"], rgb: Float[np.ndarray, "p 3"] | None, where: str
) -> CloudWithNotes:
    """A cloud of the finite points; without colours they are grey."""
    # Beyond float32 as well: stored as such, they would be infinite.
    finite = (np.abs(positions) <= _LARGEST).all(-1)
    notes = []
    if not finite.all():
        notes.append(f"{where}: {int((~finite).sum())} points that are not finite were dropped")
    if not finite.any():
        return None, (*notes, f"{where}: the cloud has no points and was taken as none")
    if rgb is None:
        rgb = np.full(positions.shape, DEFAULT_GREY)
        notes.append(f"{where}: the points have no colours and were taken as grey")
    cloud = PointCloud(
        positions=torch.from_numpy(np.ascontiguousarray(positions[finite], np.float32)),
        rgb=torch.from_numpy(np.ascontiguousarray(np.clip(rgb[finite], 0, 1), np.float32)),
    )
    return cloud, tuple(notes)


def read_cloud(file: Path) -> CloudWithNotes:
    """The vertices of a PLY file, with red, green and blue if it has them.

    Raises:
        FileFormatError: missing, damaged, or without x, y and z.
    """
    data = read_bytes(file, "a PLY file")
    try:
        columns = read_columns(data, read_header(data), "vertex")
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    if not {"x", "y", "z"} <= set(columns):
        raise FileFormatError(f"{file}: expected points with x, y and z, got {sorted(columns)[:9]}")
    positions = np.stack([columns[axis].astype(np.float64) for axis in "xyz"], -1)
    return cloud_from_arrays(positions, _colors(columns), file.name)


def find_cloud(folder: Path, names: tuple[str, ...]) -> CloudWithNotes:
    """The first of the PLY files called ``names`` that is in ``folder``.

    Raises:
        FileFormatError: it is damaged.
    """
    for name in names:
        if (folder / name).is_file():
            cloud, notes = read_cloud(folder / name)
            return cloud, (f"points to start from are those of {name}", *notes)
    return None, ()


def read_positions(file: Path) -> Float[np.ndarray, "p 3"]:
    """An array of positions.

    Raises:
        FileFormatError: missing, damaged, or of another shape.
    """
    array = npy_array(file)
    if array.ndim != 2 or array.shape[1] != 3:
        raise FileFormatError(f"{file}: expected an array of points x 3, got {array.shape}")
    return np.array(array, np.float64)


def _colors(columns: Columns) -> Float[np.ndarray, "p 3"] | None:
    if not {"red", "green", "blue"} <= set(columns):
        return None
    levels = np.stack([columns[name].astype(np.float64) for name in ("red", "green", "blue")], -1)
    # Text files and some programs store shares instead of bytes, and nothing says so.
    shares = columns["red"].dtype.kind == "f" and levels.size and np.nanmax(levels) <= 1
    return np.nan_to_num(levels if shares else levels / 255, nan=DEFAULT_GREY)

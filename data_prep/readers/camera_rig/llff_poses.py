"""``poses_bounds.npy`` of LLFF.

Axes: ``c`` cameras. Each row of 17 numbers is a 3 × 5 matrix, row by row, and the nearest and
farthest depth. The matrix's columns are the camera's axes in the world, in the order down, right,
back; its position; and height, width and focal length in pixels. So in OpenCV axes
world_from_camera = [right, down, −back | position] (Mildenhall et al., LLFF, 2019, README).
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.files.float_files import npy_array
from diff4splat.errors import FileFormatError
from diff4splat.geometry import rigid
from diff4splat.paths.formats.checks import exact_poses

_COLUMNS = 17


def read_llff(file: Path, names: list[str]) -> tuple[Float[Tensor, "c 4 4"], list[Intrinsics]]:
    """world_from_camera (OpenCV, float64) and the lens of each of the cameras ``names``.

    Raises:
        FileFormatError: missing, damaged, not finite, or with another number of rows.
    """
    rows = np.array(npy_array(file), np.float64)
    if rows.ndim != 2 or rows.shape[1] != _COLUMNS:
        raise FileFormatError(
            f"{file}: expected rows of {_COLUMNS} numbers (LLFF), got an array of {rows.shape}"
        )
    if len(rows) != len(names):
        raise FileFormatError(
            f"{file}: expected a row for each of {len(names)} cameras ({names[0]} to {names[-1]}), "
            f"got {len(rows)} rows; remove or restore cameras until both agree"
        )
    # Near and far may be missing or infinite; nothing here uses them.
    matrices = rows[:, :15].reshape(-1, 3, 5)
    _require_finite(matrices, names, file)
    down, right, back, position = (torch.from_numpy(matrices[..., i]) for i in range(4))
    poses = rigid.from_parts(torch.stack([right, down, -back], -1), position)
    return exact_poses(poses, names, str(file)), [_lens(row[:, 4], file) for row in matrices]


def _require_finite(matrices: np.ndarray, names: list[str], file: Path) -> None:
    bad = ~np.isfinite(matrices).all((1, 2))
    if bad.any():
        raise FileFormatError(
            f"{file}: {names[int(bad.argmax())]}: expected finite numbers, got NaN or infinity; "
            "find its pose again or remove the camera with its row"
        )


def _lens(height_width_focal: np.ndarray, file: Path) -> Intrinsics:
    height, width, focal_px = (float(value) for value in height_width_focal)
    if not (height >= 1 and width >= 1 and focal_px > 0):
        raise FileFormatError(
            f"{file}: expected height, width and focal length above 0, got {height:g}, {width:g} "
            f"and {focal_px:g}; repair the file"
        )
    return Intrinsics(
        focal_px=(focal_px, focal_px),
        center_px=(width / 2, height / 2),
        size_px=(round(height), round(width)),
    )

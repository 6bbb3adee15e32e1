"""Binary files of a COLMAP model, little-endian.

A count, then records. Camera: identifier, model, width, height, parameters. Image: identifier,
quaternion, translation, camera, name with a zero at its end, a count and so many 2D points. Point:
identifier, position, colour, error, a count and so many observations.
"""

import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float

from diff4splat.data_prep.readers.colmap.model import (
    MODEL_NAMES,
    PARAMETERS,
    ModelCamera,
    ModelImage,
)
from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_bytes

_POINT_2D_BYTES, _SEEN_BYTES = 24, 8


class _Bytes:
    """A sequential binary reader."""

    def __init__(self, file: Path) -> None:
        data = read_bytes(file, "a binary file of a COLMAP model")
        self.file, self._data, self._position = file, data, 0

    def take(self, layout: str) -> tuple:
        """Read the next values."""
        start = self.skip(struct.calcsize(layout))
        return struct.unpack_from(layout, self._data, start)

    def skip(self, count: int) -> int:
        """Skip ``count`` bytes; returns their offset."""
        start, self._position = self._position, self._position + count
        if self._position > len(self._data):
            raise self.cut_off()
        return start

    def text(self) -> str:
        """Bytes up to a zero."""
        end = self._data.find(b"\0", self._position)
        if end < 0:
            raise self.cut_off()
        start, self._position = self._position, end + 1
        return self._data[start:end].decode("utf-8", errors="replace")

    def cut_off(self) -> FileFormatError:
        """The error for a truncated file."""
        return FileFormatError(
            f"{self.file}: expected a whole binary COLMAP file, got one that ends too early "
            f"({len(self._data)} bytes); copy it again"
        )


def read_cameras(file: Path) -> dict[int, ModelCamera]:
    """Cameras by identifier.

    Raises:
        FileFormatError: missing, cut off, or with a model that cannot be read.
    """
    data, cameras = _Bytes(file), {}
    for _ in range(data.take("<Q")[0]):
        identifier, model, width, height = data.take("<iiQQ")
        name = MODEL_NAMES[model] if 0 <= model < len(MODEL_NAMES) else f"number {model}"
        require_known_model(name, f"{file}: camera {identifier}")
        parameters = data.take(f"<{PARAMETERS[name]}d")
        cameras[identifier] = ModelCamera(
            model=name, size_px=(height, width), parameters=parameters
        )
    return cameras


def read_images(file: Path) -> list[ModelImage]:
    """Images in the order of the file.

    Raises:
        FileFormatError: missing or cut off.
    """
    data, images = _Bytes(file), []
    for _ in range(data.take("<Q")[0]):
        _, *pose, camera = data.take("<I7dI")
        images.append(
            ModelImage(
                name=data.text(), camera=camera, quat=tuple(pose[:4]), translation=tuple(pose[4:])
            )
        )
        data.skip(data.take("<Q")[0] * _POINT_2D_BYTES)
    return images


def read_points(file: Path) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "p 3"]]:
    """Positions, and RGB in [0, 1].

    Raises:
        FileFormatError: missing or cut off.
    """
    data, rows = _Bytes(file), []
    for _ in range(data.take("<Q")[0]):
        _, *point, _, seen = data.take("<Q3d3BdQ")
        rows.append(point)
        data.skip(seen * _SEEN_BYTES)
    table = np.array(rows, np.float64).reshape(-1, 6)
    return table[:, :3], table[:, 3:] / 255


def require_known_model(name: str, where: str) -> None:
    """Refuse a camera model by its name.

    Raises:
        FileFormatError: its images can neither be straightened nor seen through it here.
    """
    if name not in PARAMETERS:
        raise FileFormatError(
            f"{where}: expected a camera model of {', '.join(PARAMETERS)}, got {name}; let COLMAP "
            "undistort the images (image_undistorter)"
        )

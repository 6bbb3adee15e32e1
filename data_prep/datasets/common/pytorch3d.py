"""Cameras of PyTorch3D as OpenCV's: row vectors, +x left, +y up, lenses in units of the image."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from diff4splat.errors import FileFormatError

_FLIP = np.array([-1.0, -1, 1])


def mapping(entry: dict[str, Any], key: str) -> dict[str, Any]:
    """The object under ``key``; nothing is an empty one."""
    value = entry.get(key)
    return value if isinstance(value, dict) else {}


def camera_of(
    entry: dict[str, Any], size_px: tuple[int, int], where: str
) -> tuple[Float64[np.ndarray, "4 4"], Float64[np.ndarray, " 4"]]:
    """camera_from_world, and (fx, fy, cx, cy) in pixels with centres at +0.5.

    Raises:
        FileFormatError: numbers are missing, or lenses are in another unit.
    """
    view = mapping(entry, "viewpoint")
    kind = view.get("intrinsics_format")
    if kind != "ndc_isotropic":
        raise FileFormatError(
            f"{where}: expected intrinsics_format 'ndc_isotropic', got {kind!r:.60}; it is of "
            "another version"
        )
    try:
        rotation = np.array(view["R"], np.float64).reshape(3, 3)
        position = np.array(view["T"], np.float64).reshape(3)
        focal = np.array(view["focal_length"], np.float64).reshape(2)
        principal = np.array(view["principal_point"], np.float64).reshape(2)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{where}: expected R, T, focal_length, principal_point") from error
    height, width = size_px
    half = min(height, width) / 2
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = _FLIP[:, None] * rotation.T, _FLIP * position
    center_px = np.array([width / 2, height / 2]) - principal * half
    return pose, np.concatenate([focal * half, center_px])

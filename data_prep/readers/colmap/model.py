"""A COLMAP model: cameras, the registered images, and points.

``cameras``, ``images`` and ``points3D`` as ``.bin`` or ``.txt``, in one folder. Poses are
camera_from_world: a quaternion wxyz and a translation, OpenCV axes; pixel centres are at +0.5
(https://colmap.github.io/format.html).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

MODEL_NAMES = (
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
)
"""By the number that binary files have for them."""
PARAMETERS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
}
"""How many numbers each of the models has that can be read."""

SPARSE_FOLDERS = ("sparse/0", "sparse", "sparse_", "colmap/sparse/0", "colmap/sparse")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCamera:
    """Intrinsics as stored."""

    model: str
    size_px: tuple[int, int]
    """(height, width)"""
    parameters: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelImage:
    """The pose of one image."""

    name: str
    """Path within the folder of images."""
    camera: int
    """Identifier of its camera."""
    quat: tuple[float, float, float, float]
    """camera_from_world, wxyz."""
    translation: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Cameras, images and points of a model."""

    folder: Path
    cameras: dict[int, ModelCamera]
    images: tuple[ModelImage, ...]
    positions: Float[np.ndarray, "p 3"]
    rgb: Float[np.ndarray, "p 3"]
    """In [0, 1]."""


def model_folder(folder: Path) -> Path | None:
    """The subfolder with a model; None without one."""
    for name in SPARSE_FOLDERS:
        if suffix_of(folder / name) is not None:
            return folder / name
    return None


def suffix_of(folder: Path) -> str | None:
    """``.bin`` or ``.txt``; binary files have priority, as in COLMAP."""
    for suffix in (".bin", ".txt"):
        if all((folder / f"{name}{suffix}").is_file() for name in ("cameras", "images")):
            return suffix
    return None

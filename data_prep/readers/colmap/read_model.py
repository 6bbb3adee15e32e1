"""Reads a COLMAP model from text or binary files, with its intrinsics and poses.

Axes: ``i`` images. With SIMPLE_PINHOLE f, c_x, c_y; PINHOLE f_x, f_y, c_x, c_y; SIMPLE_RADIAL
f, c_x, c_y, k; RADIAL f, c_x, c_y, k₁, k₂; OPENCV f_x, f_y, c_x, c_y, k₁, k₂, p₁, p₂. The fisheyes
SIMPLE_RADIAL_FISHEYE f, c_x, c_y, k; RADIAL_FISHEYE f, c_x, c_y, k₁, k₂; OPENCV_FISHEYE f_x, f_y,
c_x, c_y, k₁, k₂, k₃, k₄ (https://colmap.github.io/cameras.html).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.colmap import binary_model, text_model
from diff4splat.data_prep.readers.colmap.model import Model, ModelCamera, ModelImage, suffix_of
from diff4splat.data_prep.readers.common.fisheye_lenses import require_fisheye
from diff4splat.data_prep.readers.common.intrinsics import MAX_SIDE_PX, Intrinsics
from diff4splat.errors import FileFormatError
from diff4splat.geometry import quaternion, rigid
from diff4splat.paths.formats.checks import exact_poses

_UNIT = 1e-2
"""How far the length of a quaternion may be from 1."""


def read_model(folder: Path) -> Model:
    """The model in ``folder``; points may be missing.

    Raises:
        FileFormatError: a file is damaged, or the model has no images.
    """
    suffix = suffix_of(folder)
    files = text_model if suffix == ".txt" else binary_model
    cameras = files.read_cameras(folder / f"cameras{suffix}")
    images = files.read_images(folder / f"images{suffix}")
    for image in images:
        if image.camera not in cameras:
            raise FileFormatError(
                f"{folder}: '{image.name}': expected its camera {image.camera} among cameras"
                f"{suffix}, got none; write the model again"
            )
    if not images:
        raise FileFormatError(
            f"{folder}: expected images with poses, got none; COLMAP found no reconstruction"
        )
    points = folder / f"points3D{suffix}"
    nothing = np.zeros((0, 3))
    positions, rgb = files.read_points(points) if points.is_file() else (nothing, nothing)
    return Model(folder=folder, cameras=cameras, images=tuple(images), positions=positions, rgb=rgb)


def image_poses(images: Sequence[ModelImage], where: Path) -> Float[Tensor, "i 4 4"]:
    """world_from_camera, float64.

    Raises:
        FileFormatError: a pose is not finite, or its quaternion no rotation.
    """
    for image in images:
        length = float(np.linalg.norm(image.quat))
        if not (abs(length - 1) <= _UNIT and np.isfinite(image.translation).all()):
            raise FileFormatError(
                f"{where}: '{image.name}': expected a unit quaternion and a finite translation, "
                f"got length {length:g} and {image.translation}; write the model again"
            )
    quats = torch.tensor([image.quat for image in images], dtype=torch.float64)
    translation = torch.tensor([image.translation for image in images], dtype=torch.float64)
    rotation = quaternion.to_matrix(quaternion.normalize(quats))
    names = [f"'{image.name}'" for image in images]
    return rigid.invert(exact_poses(rigid.from_parts(rotation, translation), names, str(where)))


def camera_intrinsics(camera: ModelCamera, where: str) -> Intrinsics:
    """The intrinsics of a camera.

    Raises:
        FileFormatError: a number is not finite, a size or focal length not above 0, or a fisheye
            turns back.
    """
    numbers = camera.parameters
    # f, c_x, c_y or f_x, f_y, c_x, c_y, then what bends.
    two = camera.model in ("PINHOLE", "OPENCV", "OPENCV_FISHEYE")
    focal_px = (numbers[0], numbers[1] if two else numbers[0])
    column, row, *bent = numbers[2:] if two else numbers[1:]
    sized = all(1 <= side <= MAX_SIDE_PX for side in camera.size_px)
    if not (sized and np.isfinite(numbers).all() and min(focal_px) > 0):
        raise FileFormatError(
            f"{where}: expected sizes and focal lengths above 0 and finite numbers, got "
            f"{str(camera.size_px)[:60]} and {numbers}; write the model again"
        )
    straight = Intrinsics(focal_px=focal_px, center_px=(column, row), size_px=camera.size_px)
    four = (*bent, *[0.0] * (4 - len(bent)))
    if camera.model.endswith("FISHEYE"):
        return require_fisheye(replace(straight, model="fisheye", fisheye=four), where)
    k1, k2, p1, p2 = four
    return replace(straight, radial=(k1, k2, 0.0), tangential=(p1, p2))

"""Poses of data sets in OpenCV axes. Axes: ``t`` frames; everything float64."""

import numpy as np
import torch
from jaxtyping import Float64

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera

Matrices = Float64[np.ndarray, "t 4 4"]
_ROUNDING = 2e-3
"""Largest error of a rotation in rounded text or half precision; more is another matrix."""


def from_parts(rotation: Float64[np.ndarray, "t 3 3"], position: Float64[np.ndarray, "t 3"]):
    """[R t; 0 1] per frame."""
    poses = np.tile(np.eye(4), (len(rotation), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation, position
    return poses


def inverted(poses: Matrices) -> Matrices:
    """Inverse of rigid motions: [Rᵀ −Rᵀt; 0 1]."""
    rotation = poses[:, :3, :3].transpose(0, 2, 1)
    return from_parts(rotation, -np.einsum("tij,tj->ti", rotation, poses[:, :3, 3]))


def cleaned(poses: Matrices, where: str) -> Matrices:
    """Poses whose rotations, rounded in the file, are exact.

    Raises:
        FileFormatError: one is left-handed, scaled, sheared or not finite; says what to look for.
    """
    matrices = torch.from_numpy(np.ascontiguousarray(poses))
    try:
        rigid.require_rigid(matrices, where, _ROUNDING)
    except InputError as error:
        raise FileFormatError(str(error)) from error
    rotation = rigid.nearest_rotation(matrices[:, :3, :3]).numpy()
    return from_parts(rotation, poses[:, :3, 3])


def cameras(
    poses: Matrices, intrinsics: Float64[np.ndarray, "t 4"], size_px: tuple[int, int]
) -> Camera:
    """A batch of cameras from world_from_camera and (fx, fy, cx, cy) in pixels.

    Raises:
        FileFormatError: intrinsics that no lens has.
    """
    if not (np.isfinite(intrinsics).all() and (intrinsics[:, :2] > 0).all()):
        raise FileFormatError(
            f"intrinsics: expected finite numbers and focal lengths above 0, got {intrinsics[0]}"
        )
    return Camera(
        focal_px=torch.from_numpy(np.ascontiguousarray(intrinsics[:, :2])),
        center_px=torch.from_numpy(np.ascontiguousarray(intrinsics[:, 2:])),
        world_from_camera=torch.from_numpy(np.ascontiguousarray(poses)),
        size_px=size_px,
    )


def require_right_of(left: Matrices, right: Matrices, where: str) -> None:
    """Require that the second camera stands to the right of the first.

    Raises:
        FileFormatError: it stands to the left: the two are swapped.
    """
    first_from_world = inverted(left)
    across = np.einsum("tij,tj->ti", first_from_world[:, :3, :3], right[:, :3, 3])
    x_m = np.median((across + first_from_world[:, :3, 3])[:, 0])
    if x_m < 0:
        raise FileFormatError(
            f"{where}: expected the right camera to the right of the left one, got it {-x_m:.3g} m "
            "to the left; left and right are swapped"
        )

"""Cameras whose focal lengths suit a lens; all at the origin, with the centre in the middle.

A pinhole lens, ideal or with OpenCV's distortion, takes ``geometry.camera.pinhole`` as it is.
"""

import math
from dataclasses import replace

import torch

from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye


def blender_camera(
    size_px: tuple[int, int], sensor_mm: float = 36.0, dtype: torch.dtype = torch.float32
) -> Camera:
    """A camera for ``BlenderFisheye``: the focal length is pixels per millimetre.

    ``sensor_mm`` is the longer side of the sensor; the other follows from the image.

    Raises:
        InputError: the sensor has no size.
    """
    if not 0 < sensor_mm < math.inf:
        raise InputError(
            f"sensor_mm: expected a positive length in millimetres, got {sensor_mm}; "
            "a full-frame sensor has 36"
        )
    return pinhole(max(size_px) / sensor_mm, size_px, dtype)


def equirectangular_camera(size_px: tuple[int, int], dtype: torch.dtype = torch.float32) -> Camera:
    """A camera for ``Equirectangular``: the whole sphere fills the image."""
    height, width = size_px
    per_radian = torch.tensor([width / (2 * math.pi), height / math.pi], dtype=dtype)
    return replace(pinhole(1.0, size_px, dtype), focal_px=per_radian)


def fisheye_camera(
    fov_deg: float,
    size_px: tuple[int, int],
    lens: OpenCVFisheye,
    dtype: torch.dtype = torch.float32,
) -> Camera:
    """A camera whose field of view ``fov_deg`` spans the width of the image.

    Raises:
        InputError: the lens does not see that far.
    """
    radius, exists = lens.radii(torch.tensor(math.radians(fov_deg) / 2, dtype=torch.float64))
    if not bool(exists) or not float(radius) > 0:
        widest = 2 * math.degrees(lens.largest_angle_rad)
        raise InputError(
            f"fov_deg: expected more than 0 and at most the {widest:.4g} degrees of the lens, "
            f"got {fov_deg}; ask for less or calibrate the lens further out"
        )
    return pinhole(size_px[1] / 2 / float(radius.detach()), size_px, dtype)

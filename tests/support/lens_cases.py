"""One camera and lens of every kind, with strong but sound distortion, in float64."""

import math

import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
from diff4splat.geometry.lenses.build import (
    blender_camera,
    equirectangular_camera,
    fisheye_camera,
)
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.lenses.protocol import Lens

SIZE_PX = (480, 640)
RADIAL = (-0.3, 0.12, -0.01, 0.02, -0.01, 0.003)
TANGENTIAL = (1e-3, -2e-3)
THIN_PRISM = (1e-3, -5e-4, -2e-3, 3e-4)
FISHEYE = (0.02, -0.003, 5e-4, -2e-5)
NAMES = ("pinhole", "opencv", "fisheye", "blender", "cycles", "equirectangular")


def doubles(values: tuple[float, ...]) -> Tensor:
    """A float64 tensor."""
    return torch.tensor(values, dtype=torch.float64)


def lens_case(name: str, size_px: tuple[int, int] = SIZE_PX) -> tuple[Camera, Lens]:
    """The camera and lens of one of ``NAMES``."""
    dtype = torch.float64
    if name == "pinhole":
        return pinhole(500.0, size_px, dtype), Pinhole()
    if name == "opencv":
        lens = OpenCVPinhole(
            radial=doubles(RADIAL), tangential=doubles(TANGENTIAL), thin_prism=doubles(THIN_PRISM)
        )
        return pinhole(500.0, size_px, dtype), lens
    if name == "fisheye":
        lens = OpenCVFisheye(coefficients=doubles(FISHEYE))
        return fisheye_camera(220.0, size_px, lens, dtype), lens
    if name == "blender":
        wide = BlenderFisheye(coefficients=2.5 * doubles(BLENDER_DEFAULT), fov_rad=1.9 * math.pi)
        return blender_camera(size_px, dtype=dtype), wide
    if name == "cycles":
        signs = doubles((0.0, -5.79e-2, 0.0, 9.48e-5, -7.67e-6))
        lens = BlenderFisheye(coefficients=signs, fov_rad=math.radians(150), cycles_signs=True)
        return blender_camera(size_px, dtype=dtype), lens
    return equirectangular_camera(size_px, dtype), Equirectangular()


def pixel_grid(size_px: tuple[int, int] = SIZE_PX) -> Tensor:
    """Centres of all pixels, (h, w, 2)."""
    x = torch.arange(size_px[1], dtype=torch.float64) + 0.5
    y = torch.arange(size_px[0], dtype=torch.float64) + 0.5
    return torch.stack(torch.meshgrid(x, y, indexing="xy"), -1)

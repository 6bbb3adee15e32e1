"""``--lens``, its coefficients and its field of view: the lens and its cameras."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.options.optics import WITH_FOCAL_LENGTH, OpticsOptions
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.geometry.camera import Camera
    from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
    from diff4splat.geometry.lenses.protocol import Lens
    from diff4splat.paths.camera_path import CameraPath

SENSOR_MM, FOV_DEG = 36.0, 180.0
_ROUNDING = 1e-9
BARREL_DISTORTION = (-0.1, 0.02, 0.0, 0.0)
"""Default k1 k2 p1 p2 of an opencv lens."""


def build_lens(options: OpticsOptions, path: "CameraPath") -> tuple["Lens", "CameraPath"]:
    """The lens, and ``path`` with the focal lengths of that lens."""
    import torch

    lens = _lens(options)
    if options.lens in WITH_FOCAL_LENGTH:
        return lens, path
    poses = path.cameras.world_from_camera.to(torch.float64)
    camera = _lens_camera(options, lens, path.cameras.size_px)
    return lens, replace(path, cameras=camera.with_pose(poses))


def _lens(options: OpticsOptions) -> "Lens":
    import torch

    from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
    from diff4splat.geometry.lenses.equirectangular import Equirectangular
    from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
    from diff4splat.geometry.lenses.pinhole import Pinhole

    fov_rad = math.radians(FOV_DEG if options.fov is None else options.fov)
    given = torch.tensor(options.lens_coefficients, dtype=torch.float64)
    match options.lens:
        case "opencv":
            return _opencv(options.lens_coefficients or BARREL_DISTORTION)
        case "fisheye":
            coefficients = given if len(given) else given.new_zeros(4)
            return OpenCVFisheye(coefficients=coefficients, max_angle_rad=fov_rad / 2)
        case "blender":
            coefficients = given if len(given) else given.new_tensor(BLENDER_DEFAULT)
            negative = bool(coefficients[1] < 0)
            return BlenderFisheye(coefficients=coefficients, fov_rad=fov_rad, cycles_signs=negative)
        case "equirectangular":
            return Equirectangular()
        case _:
            return Pinhole()


def _opencv(given: tuple[float, ...]) -> "Lens":
    """Lens from coefficients in OpenCV's order."""
    import torch

    from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole

    k1, k2, p1, p2, *more = (*given, *(0.0,) * (12 - len(given)))
    return OpenCVPinhole(
        radial=torch.tensor([k1, k2, *more[:4]], dtype=torch.float64),
        tangential=torch.tensor([p1, p2], dtype=torch.float64),
        thin_prism=torch.tensor(more[4:], dtype=torch.float64),
    )


def _fisheye_fov_deg(options: OpticsOptions, lens: "OpenCVFisheye") -> float:
    """The requested field of view. Default: 180 degrees, or the largest that the lens covers.

    Raises:
        ConfigError: the distortion is not monotonic up to that angle.
    """
    widest = math.degrees(2 * lens.largest_angle_rad)
    if options.fov is not None and options.fov > widest * (1 + _ROUNDING):
        raise ConfigError(
            f"--fov: expected at most {widest:.4g} degrees, where these --lens-coefficients bend "
            f"the image back on itself, got {options.fov:g}; ask for less"
        )
    return min(FOV_DEG, widest * (1 - _ROUNDING)) if options.fov is None else options.fov


def _lens_camera(options: OpticsOptions, lens: "Lens", size_px: tuple[int, int]) -> "Camera":
    """Camera of the lens at the origin, float64."""
    import torch

    from diff4splat.geometry.lenses.build import (
        blender_camera,
        equirectangular_camera,
        fisheye_camera,
    )
    from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye

    if isinstance(lens, OpenCVFisheye):
        return fisheye_camera(_fisheye_fov_deg(options, lens), size_px, lens, torch.float64)
    if options.lens == "blender":
        sensor_mm = SENSOR_MM if options.sensor_size is None else options.sensor_size
        return blender_camera(size_px, sensor_mm, torch.float64)
    longer = max(size_px)
    return equirectangular_camera((max(round(longer / 2), 1), longer), torch.float64)

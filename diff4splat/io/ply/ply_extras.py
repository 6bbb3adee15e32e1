"""What some programs write beside Gaussians: a camera, a colour space, a time.

SHARP (Apple) adds elements after ``vertex``: ``intrinsic`` (3 × 3), ``extrinsic`` (4 × 4, world to
camera), ``image_size`` (width, height), ``color_space`` (0 sRGB, 1 linear). Our own comments name
the time.
"""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
import torch

from diff4splat.errors import Diff4SplatError
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.rigid import require_rigid
from diff4splat.io.ply.ply_body import Columns
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import color_from_dc, dc_from_color

LINEAR = 1
_MOST_PIXELS = 1 << 15
_TIME = re.compile(r"time_s (-?[0-9.]{1,20}(?:e[+-]?[0-9]{1,3})?)")


def camera_of(elements: Mapping[str, Columns]) -> Camera | None:
    """The camera of SHARP's elements; None where they are absent or make no camera."""
    size, matrix = _numbers(elements, "image_size", 2), _numbers(elements, "intrinsic", 9)
    if size is None or matrix is None:
        return None
    width, height = (int(side) for side in size)
    focal_px = float(matrix[0])
    if not (0 < width <= _MOST_PIXELS and 0 < height <= _MOST_PIXELS and 0 < focal_px < 1e6):
        return None
    camera = pinhole(focal_px, (height, width))
    pose = _numbers(elements, "extrinsic", 16)
    if pose is None:
        return camera
    with suppress(Diff4SplatError, RuntimeError):
        world_from_camera = torch.linalg.inv(torch.from_numpy(pose).view(4, 4))
        require_rigid(world_from_camera, "extrinsic")
        return camera.with_pose(world_from_camera.float())
    return camera


def is_linear(elements: Mapping[str, Columns]) -> bool:
    """Whether the colours are proportional to light."""
    index = _numbers(elements, "color_space", 1)
    return index is not None and int(index[0]) == LINEAR


def with_srgb(gaussians: Gaussians) -> Gaussians:
    """Colours proportional to light as sRGB; harmonics keep their share of the first one."""
    linear = color_from_dc(gaussians.sh[:, :1].double()).clamp_min(0)
    srgb = torch.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear.clamp_min(1e-9) ** (1 / 2.4) - 0.055
    )
    first = dc_from_color(srgb).to(gaussians.sh)
    return replace(gaussians, sh=torch.cat([first, gaussians.sh[:, 1:]], 1))


def time_of(comments: tuple[str, ...]) -> float | None:
    """The time in seconds that our own files name."""
    found = [match for text in comments if (match := _TIME.fullmatch(text))]
    time_s = float(found[0][1]) if found and found[0][1].count(".") < 2 else None
    return time_s if time_s is not None and abs(time_s) < 1e9 else None


def _numbers(elements: Mapping[str, Columns], name: str, count: int) -> np.ndarray | None:
    """The single column of an element, if it holds ``count`` finite numbers."""
    columns = elements.get(name, {})
    values = columns.get(name)
    if values is None or len(values) != count:
        return None
    numbers = values.astype(np.float64)
    return numbers if np.isfinite(numbers).all() else None

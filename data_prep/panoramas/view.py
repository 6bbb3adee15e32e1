"""One pinhole view of an equirectangular panorama. Axes: ``h w`` pixels."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch

from diff4splat.geometry.lenses.equirectangular import Equirectangular


@dataclass(frozen=True, slots=True, kw_only=True)
class PanoramaView:
    """Where a view looks, and how wide."""

    size_px: tuple[int, int]
    """Height and width."""
    fov_deg: float
    """Horizontal field of view."""
    yaw_deg: float = 0.0
    """To the right of the middle of the panorama."""
    pitch_deg: float = 0.0
    """Upward."""
    roll_deg: float = 0.0
    """Of the camera, clockwise."""


def panorama_view(panorama: np.ndarray, view: PanoramaView) -> np.ndarray:
    """The view's pixels, linear between those of ``panorama`` (``h w 3``, of the whole sphere)."""
    (height, width), sides = view.size_px, panorama.shape[:2]
    focal_px = width / 2 / math.tan(math.radians(view.fov_deg) / 2)
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    x, y = _turned(x, y, math.radians(view.roll_deg))
    pitch = math.radians(view.pitch_deg)
    down = y * math.cos(pitch) - focal_px * math.sin(pitch)
    forward = y * math.sin(pitch) + focal_px * math.cos(pitch)
    directions = torch.from_numpy(np.stack([x, down, forward], -1))
    longitude, latitude = Equirectangular().points(directions)[0].numpy().transpose(2, 0, 1)
    yaw = longitude + math.radians(view.yaw_deg)
    columns = (yaw / (2 * math.pi) + 0.5) * sides[1] - 0.5
    rows = (latitude / math.pi + 0.5) * sides[0] - 0.5
    maps = (columns.astype(np.float32), rows.astype(np.float32))
    return cv2.remap(panorama, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)


def _turned(x: np.ndarray, y: np.ndarray, angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return cos * x - sin * y, sin * x + cos * y

"""Where a cutout lies in an image: size, place, rotation, mirror and perspective.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from diff4splat.data_prep.cutouts.cutout import Cutout

SIDES = (0.14, 1.0)
"""Longer side, as a share of the image's; small ones as often as large ones, by factors."""
PLACES = (0.1, 0.9)
"""Of the centre."""
ROTATION_DEG, PERSPECTIVE = 14.0, 0.12
"""Standard deviation; largest shift of a corner, as a share of the side."""
_SOFT_PX = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Where the corners of a cutout go."""

    corners_px: Float32[np.ndarray, "4 2"]
    """x y of the first, from the upper left one clockwise."""
    blur_px: float


def draw_placement(
    cutout: Cutout, size_px: tuple[int, int], random: np.random.Generator
) -> Placement:
    """Somewhere in an image of ``size_px``, height and width."""
    height, width = cutout.rgba.shape[:2]
    side = min(size_px) * float(np.exp(random.uniform(*np.log(SIDES))))
    half = 0.5 * side / max(height, width) * np.array([width, height])
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = signs * half * (1 + random.uniform(-PERSPECTIVE, PERSPECTIVE, (4, 2)))
    if random.random() < 0.5:
        corners = corners * [-1, 1]
    angle = np.radians(random.normal(0, ROTATION_DEG))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    center = random.uniform(*PLACES, 2) * size_px[::-1]
    return Placement(
        corners_px=(corners @ turn + center).astype(np.float32),
        blur_px=_SOFT_PX * random.random(),
    )


def placed(
    cutout: Cutout, placement: Placement, size_px: tuple[int, int]
) -> Float32[np.ndarray, "h w 4"]:
    """The cutout alone in an image of ``size_px``; colours are multiplied by the opacity."""
    reduced = _near_size(cutout.rgba, placement)
    height, width = reduced.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32) - 0.5
    matrix = cv2.getPerspectiveTransform(corners, placement.corners_px - 0.5)
    image = np.concatenate([reduced[..., :3] * reduced[..., 3:], reduced[..., 3:]], -1)
    image = cv2.warpPerspective(image, matrix, size_px[::-1], flags=cv2.INTER_LINEAR)
    if placement.blur_px > 0.2:
        image = cv2.GaussianBlur(image, (0, 0), placement.blur_px)
    return image


def _near_size(
    rgba: Float32[np.ndarray, "h w 4"], placement: Placement
) -> Float32[np.ndarray, "p q 4"]:
    """Reduced to about the size that it is shown with, since warps take single pixels."""
    corners = placement.corners_px
    width, height = (np.linalg.norm(corners[k] - corners[0]) for k in (1, 3))
    sides = [
        int(np.clip(np.ceil(shown), 1, side))
        for shown, side in ((width, rgba.shape[1]), (height, rgba.shape[0]))
    ]
    return cv2.resize(rgba, tuple(sides), interpolation=cv2.INTER_AREA)

"""Depth from the affine point map of MoGe: an offset of z that the focal length decides.

    u − c = f x / (z + shift)   ⇒   f x = (u − c)(z + shift),

which is linear in the shift. A robust fit (iteratively reweighted) keeps wrong points out.
"""

import numpy as np

from diff4splat.errors import FileFormatError

_ROUNDS = 10
_LEAST_POINTS = 16


def point_map_depth(
    points: np.ndarray, known: np.ndarray, focal_px: tuple[float, float]
) -> np.ndarray:
    """Z of points (h, w, 3) with their offset; NaN where not ``known`` (h, w).

    ``focal_px`` is (f_x, f_y) in pixels of the map; its middle is the principal point.

    Raises:
        FileFormatError: too few points are known.
    """
    height, width = known.shape
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    offsets = np.stack([columns - width / 2, rows - height / 2], -1)[known]
    chosen = points[known].astype(np.float64)
    if len(chosen) < _LEAST_POINTS:
        raise FileFormatError("depth network: expected known points, got an empty mask")
    residual = np.asarray(focal_px) * chosen[:, :2] - offsets * chosen[:, 2:]
    shift = _robust_ratio(offsets.ravel(), residual.ravel())
    depth = points[..., 2] + shift
    return np.where(known & (depth > 0), depth, np.nan).astype(np.float32)


def _robust_ratio(x: np.ndarray, y: np.ndarray) -> float:
    """The r of y ≈ r x with the least sum of absolute errors."""
    weight = np.ones_like(x)
    ratio = 0.0
    for _ in range(_ROUNDS):
        ratio = float((weight * x * y).sum() / max((weight * x * x).sum(), 1e-12))
        error = np.abs(y - ratio * x)
        weight = 1 / np.maximum(error, np.median(error) * 0.1 + 1e-9)
    return ratio

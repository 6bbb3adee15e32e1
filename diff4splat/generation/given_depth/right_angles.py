"""The offset of inverse depth that makes surfaces perpendicular (ours).

A plane n · X = d has the inverse depth w = (n_x x + n_y y + n_z) / d on the image plane (x, y, 1):
a linear function. A map v = a w + b has the gradient (∂v/∂x, ∂v/∂y), and with infinity at v = b

    n ∝ (∂v/∂x, ∂v/∂y, v − x ∂v/∂x − y ∂v/∂y − b),

so an offset only changes the third component of every normal. The score of an offset is the share
of pairs of pixels whose normals are perpendicular. Where planes meet at right angles it has a peak.
"""

import cv2
import numpy as np

SIDE_PX = 172
"""The map is looked at about this large."""
STEP_PX = 3
"""Distance of the differences."""
BLUR = 1.0
"""Standard deviation of a blur before them, in their pixels: 8 bits are steps."""
SMOOTH = 0.15
"""Change of a gradient over that distance, of the range, beyond which there is an edge."""
WIDTH = 0.06
"""Cosine that still counts as perpendicular."""
PAIRS, LEAST_PIXELS = 20_000, 500


def perpendicular_shares(
    values: np.ndarray, offsets: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """The share of perpendicular pairs with infinity at each of ``offsets``; 0 without an opinion.

    Args:
        values: (h, w), NaN where unknown.
        offsets: (n,), below the far end.
        tangents: x/z of the columns and y/z of the rows.
    """
    normals = _gradients(values, tangents)
    if normals is None:
        return np.zeros(len(offsets))
    pairs = np.random.default_rng(0).integers(len(normals), size=(2, PAIRS))
    return np.array([_perpendicular_share(normals, float(b), pairs) for b in offsets])


def _gradients(values: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]) -> np.ndarray | None:
    """(n, 3) normals at infinity 0 of pixels without an edge near them."""
    scale = max(1, round(max(values.shape) / SIDE_PX))
    smooth = cv2.GaussianBlur(values.astype(np.float32), (0, 0), BLUR * scale)
    v = smooth[scale // 2 :: scale, scale // 2 :: scale].astype(np.float64)
    x, y = (tangent[scale // 2 :: scale] for tangent in tangents)
    if min(v.shape) <= 4 * STEP_PX:
        return None
    spread = float(np.nanquantile(v, 0.98) - np.nanquantile(v, 0.02))
    right, left = _differences(v, x[None], 1)
    down, up = _differences(v, y[:, None], 0)
    inner = (slice(STEP_PX, -STEP_PX),) * 2
    slope_x, slope_y = (right + left) / 2, (down + up) / 2
    third = v[inner] - x[None, STEP_PX:-STEP_PX] * slope_x - y[STEP_PX:-STEP_PX, None] * slope_y
    with np.errstate(invalid="ignore"):
        inside = (np.abs(right - left) < SMOOTH * spread) & (np.abs(down - up) < SMOOTH * spread)
    inside &= np.isfinite(third)
    found = np.stack([slope_x, slope_y, third], -1)[inside]
    return found if len(found) >= LEAST_PIXELS else None


def _differences(v: np.ndarray, place: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Slopes to the next and the last pixel along an axis, on the inner pixels."""
    place = np.broadcast_to(place, v.shape)
    across = slice(STEP_PX, -STEP_PX)

    def taken(array: np.ndarray, part: slice) -> np.ndarray:
        return array[(part, across) if axis == 0 else (across, part)]

    here, after, before = across, slice(2 * STEP_PX, None), slice(None, -2 * STEP_PX)
    return tuple(
        (taken(v, end) - taken(v, start)) / (taken(place, end) - taken(place, start))
        for start, end in ((here, after), (before, here))
    )


def _perpendicular_share(normals: np.ndarray, infinity: float, pairs: np.ndarray) -> float:
    moved = normals - np.array([0.0, 0.0, infinity])
    moved /= np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-12)
    cosine = (moved[pairs[0]] * moved[pairs[1]]).sum(1)
    return float(np.exp(-((cosine / WIDTH) ** 2)).mean())

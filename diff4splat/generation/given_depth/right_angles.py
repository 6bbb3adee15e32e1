"""The offset of inverse depth that makes surfaces perpendicular (ours).

A plane n · X = d has the inverse depth w = (n_x x + n_y y + n_z) / d on the image plane (x, y, 1):
a linear function. A map v = a w + b has the gradient (∂v/∂x, ∂v/∂y), and with infinity at v = b

    n ∝ (∂v/∂x, ∂v/∂y, v − x ∂v/∂x − y ∂v/∂y − b),

so an offset only changes the third component of every normal. Evidence for an offset is the share
of pairs of pixels whose normals are perpendicular, among pairs anywhere (walls and floors) and
among near ones (the faces of one object). Where planes meet at right angles both have peaks.
"""

import cv2
import numpy as np

SIDE_PX = 172
"""The map is looked at about this large."""
STEP_PX = 3
"""Distance of the differences."""
BLUR, BLUR_OF_8_BITS = 1.0, 2.0
"""Standard deviation of a blur before them, in their pixels: 8 bits are steps."""
SMOOTH = 0.15
"""Change of a gradient over that distance, of the range, beyond which there is an edge."""
WIDTH = 0.06
"""Cosine that still counts as perpendicular."""
PAIRS, NEAR_PX, LEAST_PIXELS = 12_000, 14, 500
"""Pairs of each sort, how far near ones are apart at most, and pixels that are needed."""
CHANCE = {"any": 0.01, "near": 0.0015}
"""Share of perpendicular pairs of each sort that means nothing."""


def right_angle_evidence(
    values: np.ndarray, offsets: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """How much speaks for infinity at each of ``offsets``; 1 is nothing.

    Args:
        values: (h, w), NaN where unknown.
        offsets: (n,), below the far end.
        tangents: x/z of the columns and y/z of the rows.
    """
    found = _gradients(values, tangents)
    if found is None:
        return np.ones(len(offsets))
    normals, inside = found
    rng = np.random.default_rng(0)
    flat = np.flatnonzero(inside)
    pairs = {"any": rng.choice(flat, (2, PAIRS)), "near": _near_pairs(inside, rng)}
    evidence = np.ones(len(offsets))
    for name, indices in pairs.items():
        chosen = normals.reshape(-1, 3)[indices]
        shares = np.array([_perpendicular_share(chosen, float(b)) for b in offsets])
        evidence *= 1 + shares / CHANCE[name]
    return evidence


def _near_pairs(inside: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(2, n) flat indices of pixels that are near each other and both without an edge."""
    rows, columns = np.nonzero(inside)
    first = rng.integers(len(rows), size=2 * PAIRS)
    moves = rng.integers(-NEAR_PX, NEAR_PX + 1, (2, 2 * PAIRS))
    height, width = inside.shape
    row = np.clip(rows[first] + moves[0], 0, height - 1)
    column = np.clip(columns[first] + moves[1], 0, width - 1)
    valid = inside[row, column]
    pairs = np.stack([rows[first] * width + columns[first], row * width + column])[:, valid]
    return pairs[:, :PAIRS]


def _gradients(
    values: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """(h, w, 3) normals at infinity 0, and (h, w) where no edge is near."""
    scale = max(1, round(max(values.shape) / SIDE_PX))
    blur = BLUR_OF_8_BITS if len(np.unique(values)) <= 256 else BLUR
    smooth = cv2.GaussianBlur(values.astype(np.float32), (0, 0), blur * scale)
    v = smooth[scale // 2 :: scale, scale // 2 :: scale].astype(np.float64)
    x, y = (tangent[scale // 2 :: scale] for tangent in tangents)
    if min(v.shape) <= 4 * STEP_PX:
        return None
    known = v[np.isfinite(v)]
    if known.size < LEAST_PIXELS:
        return None
    spread = float(np.quantile(known, 0.98) - np.quantile(known, 0.02))
    right, left = _differences(v, x[None], 1)
    down, up = _differences(v, y[:, None], 0)
    inner = (slice(STEP_PX, -STEP_PX),) * 2
    slope_x, slope_y = (right + left) / 2, (down + up) / 2
    third = v[inner] - x[None, STEP_PX:-STEP_PX] * slope_x - y[STEP_PX:-STEP_PX, None] * slope_y
    with np.errstate(invalid="ignore"):
        inside = (np.abs(right - left) < SMOOTH * spread) & (np.abs(down - up) < SMOOTH * spread)
    inside &= np.isfinite(third)
    normals = np.stack([slope_x, slope_y, third], -1).astype(np.float32)
    return (normals, inside) if inside.sum() >= LEAST_PIXELS else None


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


def _perpendicular_share(normals: np.ndarray, infinity: float) -> float:
    """Of pairs (2, n, 3)."""
    moved = normals - np.array([0, 0, infinity], dtype=np.float32)
    lengths = np.maximum((moved * moved).sum(-1), 1e-30)
    cosine = (moved[0] * moved[1]).sum(-1) / np.sqrt(lengths[0] * lengths[1])
    return float(np.exp(-((cosine / WIDTH) ** 2)).mean())

"""Planes and quadrics in inverse depth: what they are under any offset.

A plane is linear in (x, y); a quadric is Σ over products of (x, y, 1, value), twice. Least squares
of the distance along the value in standard deviations (Sampson). Fits return a function that gives
that distance at any points.
"""

from collections.abc import Callable

import numpy as np

from diff4splat.generation.given_depth.surfaces.points import Points

Distance = Callable[[Points], np.ndarray]
Fit = Callable[[Points], Distance]
QUADRIC_ROUNDS = 3
FLAT = 1e-3
"""Least share of a quadric's largest slope that weights may grow by."""
CAP = 6.0
"""Standard deviations that a point counts at most."""


def plane_fit(points: Points) -> Distance:
    """The plane through points."""
    rows = np.stack([points.x, points.y, np.ones(len(points))], -1) / points.sigma[:, None]
    found = np.linalg.lstsq(rows, points.value / points.sigma, rcond=None)[0]

    def distance(at: Points) -> np.ndarray:
        expected = at.x * found[0] + at.y * found[1] + found[2]
        return np.abs(at.value - expected) / at.sigma

    return distance


def plane_normal(points: Points) -> np.ndarray:
    """(3,): coefficients of x, y and 1, the normal with infinity at 0."""
    rows = np.stack([points.x, points.y, np.ones(len(points))], -1) / points.sigma[:, None]
    return np.linalg.lstsq(rows, points.value / points.sigma, rcond=None)[0]


def quadric_fit(points: Points) -> Distance:
    """The quadric through points, with its own units for conditioning."""
    stacked = np.stack([points.x, points.y, points.value], -1)
    center, unit = stacked.mean(0), stacked.std(0) + np.finfo(np.float32).tiny

    def scaled(at: Points) -> tuple[np.ndarray, ...]:
        triples = zip((at.x, at.y, at.value), center, unit, strict=True)
        return tuple((values - middle) / size for values, middle, size in triples)

    own = scaled(points)
    rows, weights, found = _monomials(*own), np.ones(len(points)), np.zeros(10)
    for _ in range(QUADRIC_ROUNDS):
        weighted = rows * weights[:, None]
        found = np.linalg.eigh(weighted.T @ weighted)[1][:, 0]
        slope = np.abs(_slope(found, *own))
        weights = 1 / (np.maximum(slope, FLAT * slope.max()) * points.sigma)
        weights /= weights.max()

    def distance(at: Points) -> np.ndarray:
        places = scaled(at)
        slope = np.abs(_slope(found, *places)) / unit[2]
        off = np.abs(_monomials(*places) @ found)
        return off / np.maximum(slope * at.sigma, np.finfo(np.float64).tiny)

    return distance


def rms(distance: np.ndarray) -> np.ndarray:
    """Root mean square over the last axis; a point counts ``CAP`` at most."""
    return np.asarray(np.sqrt((np.minimum(np.abs(distance), CAP) ** 2).mean(-1)))


def _monomials(x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([x * x, x * y, y * y, x, y, np.ones_like(x), x * v, y * v, v, v * v], -1)


def _slope(found: np.ndarray, x: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
    return found[6] * x + found[7] * y + found[8] + 2 * found[9] * v

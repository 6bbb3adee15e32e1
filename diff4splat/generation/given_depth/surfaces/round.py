"""Spheres and cylinders of revolution: only the true offset leaves a quadric round.

With infinity at b, u = value − b. A point p / u, p = (x, y, 1), lies on a

    sphere:    |p|² = 2 (C · p) u − k u²
    cylinder:  |p × a|² = 2 (C · p) u − k u²,   C ⊥ axis a

Both are linear in C and k. The axis is perpendicular to all normals, which are
(∂v/∂x, ∂v/∂y, v − x ∂v/∂x − y ∂v/∂y − b). Any other offset turns a sphere into another quadric, and
errors grow from the noise to many times it. Axes: ``b`` offsets, ``n`` points.
"""

import numpy as np

from diff4splat.generation.given_depth.surfaces.fits import rms
from diff4splat.generation.given_depth.surfaces.points import Points

ROUNDS = 2
"""Of weights."""
AXIS_ROUNDS, AXIS_STEP, MOST_TURN = 2, 1e-3, 0.2
"""Gauss-Newton steps of a cylinder's axis, the angle of differences, and the largest step, rad."""
TINY = 1e-12


def sphere_errors(points: Points, offsets: np.ndarray) -> np.ndarray:
    """(b,) error of the best sphere under each offset, in standard deviations."""
    u = points.value - offsets[:, None]
    x, y = (np.broadcast_to(place, u.shape) for place in (points.x, points.y))
    squared = x * x + y * y + 1
    return rms(_residuals([x, y, np.ones_like(u)], u, squared, points.sigma))


def cylinder_errors(points: Points, offsets: np.ndarray) -> np.ndarray:
    """(b,) error of the best cylinder under each offset."""
    frames = _frames(points, offsets)
    off = _cylinder(points, offsets, frames)
    for _ in range(AXIS_ROUNDS):
        turned = _turned(frames, _axis_step(points, offsets, frames, off))
        tried = _cylinder(points, offsets, turned)
        better = rms(tried) < rms(off)
        frames = np.where(better[:, None, None], turned, frames)
        off = np.where(better[:, None], tried, off)
    return rms(off)


def _cylinder(points: Points, offsets: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """(b, n) distances; frames (b, 3, 3) have the axis as first column."""
    u = points.value - offsets[:, None]
    p = np.stack([points.x, points.y, np.ones(len(points))])
    across, along = (np.einsum("bi,in->bn", frames[:, :, i], p) for i in (1, 2))
    return _residuals([across, along], u, across**2 + along**2, points.sigma)


def _residuals(
    places: list[np.ndarray], u: np.ndarray, squared: np.ndarray, sigma: np.ndarray
) -> np.ndarray:
    """Distances along u from the best c and k: squared = Σ c_i place_i u + k u²."""
    rows = np.stack([*(place * u for place in places), u * u], -1)
    weights = 1 / np.maximum(np.abs(u) * sigma, TINY * sigma)
    off = np.zeros_like(u)
    for _ in range(ROUNDS):
        found = _least_squares(rows, squared, weights)
        slope = 2 * found[:, -1:] * u
        for number, place in enumerate(places):
            slope = slope + found[:, number : number + 1] * place
        weights = 1 / (np.maximum(np.abs(slope), TINY) * sigma)
        off = (squared - np.einsum("bni,bi->bn", rows, found)) * weights
    return off


def _least_squares(rows: np.ndarray, target: np.ndarray, weights: np.ndarray) -> np.ndarray:
    weighted = rows * weights[..., None]
    unit = np.sqrt((weighted**2).sum(1, keepdims=True)) + np.finfo(np.float64).tiny
    weighted = weighted / unit
    matrix = np.einsum("bni,bnj->bij", weighted, weighted) + TINY * np.eye(rows.shape[-1])
    right = np.einsum("bni,bn->bi", weighted, target * weights)
    return np.linalg.solve(matrix, right[..., None])[..., 0] / unit[:, 0]


def _frames(points: Points, offsets: np.ndarray) -> np.ndarray:
    """Axes perpendicular to the normals, with two directions beside them."""
    sx, sy = points.slope_x, points.slope_y
    third = points.value - points.x * sx - points.y * sy - offsets[:, None]
    sx, sy = np.broadcast_to(sx, third.shape), np.broadcast_to(sy, third.shape)
    normals = np.stack([sx, sy, third], -1)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), TINY)
    return np.linalg.eigh(np.einsum("bni,bnj->bij", normals, normals))[1]


def _axis_step(
    points: Points, offsets: np.ndarray, frames: np.ndarray, off: np.ndarray
) -> np.ndarray:
    """(b, 2) angles of a Gauss-Newton step."""
    slopes = []
    for axis in range(2):
        angles = np.zeros((len(frames), 2))
        angles[:, axis] = AXIS_STEP
        slopes.append((_cylinder(points, offsets, _turned(frames, angles)) - off) / AXIS_STEP)
    slopes = np.stack(slopes, -1)
    matrix = np.einsum("bni,bnj->bij", slopes, slopes)
    matrix = matrix + (1e-6 * np.trace(matrix, axis1=1, axis2=2) + TINY)[:, None, None] * np.eye(2)
    right = np.einsum("bni,bn->bi", slopes, off)
    return np.clip(-np.linalg.solve(matrix, right[..., None])[..., 0], -MOST_TURN, MOST_TURN)


def _turned(frames: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Frames whose axis leans by two angles towards the other directions."""
    axis, first = frames[:, :, 0], frames[:, :, 1]
    axis = axis + angles[:, :1] * first + angles[:, 1:] * frames[:, :, 2]
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    first = first - (axis * first).sum(1, keepdims=True) * axis
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([axis, first, np.cross(axis, first)], -1)

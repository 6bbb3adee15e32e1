"""Logarithm of how much the surfaces of a depth map speak for each offset.

A segment that one offset makes a sphere or a cylinder, within the precision of its points and far
better than others do, is probably one; a pair of planes may be perpendicular, and probably is where
they meet. Each adds log((1 − p) + p · likelihood / likelihood of anything): with a false one in the
list the others still decide.
"""

from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Float64

from diff4splat.generation.given_depth.surfaces.fits import plane_normal
from diff4splat.generation.given_depth.surfaces.points import Points
from diff4splat.generation.given_depth.surfaces.round import cylinder_errors, sphere_errors
from diff4splat.generation.given_depth.surfaces.segments import Segment

POINTS = 300
"""Of a segment that are looked at."""
ROUND_ERROR = 1.5
"""Standard deviations up to which a surface is round."""
CLEAR_NATS = 8.0
"""How much worse, in log likelihood, the median offset must be: else the shape says nothing."""
CORRELATED, MOST_POINTS = 4.0, 300.0
"""Points per independent one, and independent points that a segment counts at most."""
FALSE_ROUND = 0.005
"""Odds that a round segment is so by accident."""
MEETING, ANYWHERE = 0.6, 0.05
"""Share of perpendicular pairs among planes that meet, and among others."""
COSINE = 0.012
"""Standard deviation of the cosine of a right angle."""
MOST_PLANES, NEAR_PX, LEAST_BORDER = 14, 3, 25
MEET_PX = 3.0
"""Two planes meet if they differ by less than they change over so many points."""

Log = Float64[np.ndarray, " b"]


def surface_evidence(grid: Points, segments: list[Segment], offsets: np.ndarray) -> Log:
    """0 where nothing speaks for or against an offset."""
    curved = [grid.at(one.mask) for one in segments if not one.is_plane]
    total = sum((round_evidence(points, offsets) for points in curved), np.zeros(len(offsets)))
    return total + plane_evidence(grid, [one.mask for one in segments if one.is_plane], offsets)


def round_evidence(points: Points, offsets: np.ndarray) -> Log:
    """Of one curved segment."""
    chosen = points.thinned(POINTS)
    count = min(len(points) / CORRELATED, MOST_POINTS)
    found = np.zeros(len(offsets))
    for errors in (sphere_errors(chosen, offsets), cylinder_errors(chosen, offsets)):
        least = errors.min()
        nats = -count / 2 * ((errors / max(least, 1e-6)) ** 2 - 1)
        if least < ROUND_ERROR and np.median(nats) < -CLEAR_NATS:
            found = found + np.logaddexp(nats, np.log(FALSE_ROUND)) - np.log(FALSE_ROUND)
    return found


def plane_evidence(grid: Points, planes: list[np.ndarray], offsets: np.ndarray) -> Log:
    """Of all pairs of the largest planes."""
    planes = sorted(planes, key=np.count_nonzero, reverse=True)[:MOST_PLANES]
    normals = [plane_normal(grid.at(mask)) for mask in planes]
    found = np.zeros(len(offsets))
    for one, other in combinations(range(len(planes)), 2):
        pair = (normals[one], normals[other])
        share = MEETING if _meet(grid, (planes[one], planes[other]), pair) else ANYWHERE
        cosine = _cosine(*pair, offsets)
        likelihood = np.exp(-0.5 * (cosine / COSINE) ** 2) / (COSINE * np.sqrt(2 * np.pi))
        # Of any angle the cosine is even in [-1, 1].
        found = found + np.log(1 - share + share * likelihood / 0.5)
    return found


def _cosine(one: np.ndarray, other: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    a, b = (normal - offsets[:, None] * np.array([0.0, 0.0, 1.0]) for normal in (one, other))
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return (a * b).sum(1) / np.maximum(lengths, np.finfo(np.float64).tiny)


def _meet(
    grid: Points, masks: tuple[np.ndarray, np.ndarray], normals: tuple[np.ndarray, np.ndarray]
) -> bool:
    """Whether two planes have one edge: where both are near, both have the same value."""
    kernel = np.ones((2 * NEAR_PX + 1,) * 2, dtype=np.uint8)
    near = np.logical_and(*(cv2.dilate(mask.astype(np.uint8), kernel) > 0 for mask in masks))
    if near.sum() < LEAST_BORDER:
        return False
    x, y = grid.x[near], grid.y[near]
    a, b, c = normals[0] - normals[1]
    change = np.maximum(*(np.abs(normal[:2]) for normal in normals))
    point = abs(float(grid.x[0, 1] - grid.x[0, 0]))
    return bool(np.median(np.abs(a * x + b * y + c)) < MEET_PX * point * np.hypot(*change))

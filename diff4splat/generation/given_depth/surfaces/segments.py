"""Planes and curved quadrics that a depth map shows: regions grown from random windows."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool

from diff4splat.generation.given_depth.surfaces.fits import (
    Fit,
    plane_fit,
    quadric_fit,
    rms,
)
from diff4splat.generation.given_depth.surfaces.points import Points

SEEDS = 300
TRIALS, LEAST_SHARE = 30, 0.5
"""After so many windows, a map of which fewer than this share are on a surface is given up: it is
not precise enough, or nothing in it is regular."""
RADII_PX = (9, 6, 4)
"""Half the sides of the windows that a region may start as; the largest that fits is taken."""
FULL = 0.8
"""Share of a window that must be free."""
START_RMS, END_RMS, PLANE_RMS = 1.2, 1.5, 1.25
"""Largest errors of a start, of a region and of a plane, in standard deviations."""
REACH, FIRST_REACH, FIRST_ROUNDS = 3.5, 6.0, 3
"""A neighbour belongs to the region up to here, and in the first rounds, when a small window says
little of what is far from it."""
ROUNDS, LEAST_PLANE, LEAST_CURVED = 8, 60, 100
PLANE_SEEDS, PLANE_SHARE = 4, 0.7
"""Where planes within a quadric are looked for, and the share of it that they must be."""
ALIKE = 1.15
"""A quadric that is better than a plane by less is a plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One surface."""

    mask: Bool[np.ndarray, "h w"]
    is_plane: bool


def find_segments(grid: Points) -> list[Segment]:
    """Surfaces of a grid (h, w), none of which overlap."""
    rng = np.random.default_rng(0)
    free, found, tried, reached = grid.known, [], 0, 0
    places = (rng.integers(side, size=SEEDS).tolist() for side in free.shape)
    for seed in zip(*places, strict=True):
        if grid.known[seed]:
            tried += 1
            segment = _grown(grid, free, seed) if free[seed] else None
            if segment is not None:
                free = free & ~segment.mask
                found.append(segment)
            reached += not free[seed]
        if tried >= TRIALS and reached < LEAST_SHARE * tried:
            break
    return found


def covered_share(grid: Points, segments: list[Segment]) -> float:
    """Share of the known map that the segments are."""
    return sum(int(one.mask.sum()) for one in segments) / max(int(grid.known.sum()), 1)


def _grown(grid: Points, free: np.ndarray, seed: tuple[int, int]) -> Segment | None:
    """The surface at a free point: a plane, or a quadric that is not made of planes."""
    start = _start(grid, free, seed)
    if start is None:
        return None
    curved = _region(quadric_fit, grid, free, start, seed, LEAST_CURVED)
    if curved is None or _error(quadric_fit, grid, curved) > END_RMS:
        flat = _plane(grid, free, seed)
        return None if flat is None else Segment(mask=flat, is_plane=True)
    flat = _planes_within(grid, curved, seed)
    return Segment(mask=curved if flat is None else flat, is_plane=flat is not None)


def _planes_within(grid: Points, region: np.ndarray, seed: tuple[int, int]) -> np.ndarray | None:
    """The largest of a few planes if these are all of a region: two planes are a quadric too."""
    error = _error(plane_fit, grid, region)
    if error < max(PLANE_RMS, ALIKE * _error(quadric_fit, grid, region)):
        return region
    places = np.argwhere(region)
    chosen = np.linspace(0, len(places) - 1, PLANE_SEEDS + 2)[1:-1].astype(int)
    seeds = [seed, *map(tuple, places[chosen].tolist())]
    planes = [one for one in (_plane(grid, region, at) for at in seeds) if one is not None]
    if not planes or np.logical_or.reduce(planes).sum() < PLANE_SHARE * region.sum():
        return None
    return max(planes, key=np.count_nonzero)


def _start(grid: Points, free: np.ndarray, seed: tuple[int, int]) -> np.ndarray | None:
    """The largest window around a seed that one quadric explains."""
    for radius in RADII_PX:
        window = _window(free, seed, radius)
        full = window.sum() >= FULL * (2 * radius + 1) ** 2
        if full and _error(quadric_fit, grid, window) < START_RMS:
            return window
    return None


def _plane(grid: Points, free: np.ndarray, seed: tuple[int, int]) -> np.ndarray | None:
    window = _window(free, seed, RADII_PX[-1])
    if window.sum() < 3 or _error(plane_fit, grid, window) > PLANE_RMS:
        return None
    region = _region(plane_fit, grid, free, window, seed, LEAST_PLANE)
    is_flat = region is not None and _error(plane_fit, grid, region) < PLANE_RMS
    return region if is_flat else None


def _region(
    fit: Fit, grid: Points, free: np.ndarray, start: np.ndarray, seed: tuple[int, int], least: int
) -> np.ndarray | None:
    """The connected pixels on the surface through ``start``, which is fitted to them again."""
    region = start
    for number in range(ROUNDS):
        reach = FIRST_REACH if number < FIRST_ROUNDS else REACH
        near = (fit(grid.at(region))(grid) < reach) & free
        if not near[seed]:
            return None
        labels = cv2.connectedComponents(near.astype(np.uint8), connectivity=4)[1]
        grown = labels == labels[seed]
        if grown.sum() < least:
            return None
        settled = number > FIRST_ROUNDS and (grown != region).sum() < 0.01 * region.sum()
        region = grown
        if settled:
            break
    return region


def _window(free: np.ndarray, seed: tuple[int, int], radius: int) -> np.ndarray:
    window = np.zeros(free.shape, dtype=bool)
    rows, columns = (slice(max(place - radius, 0), place + radius + 1) for place in seed)
    window[rows, columns] = free[rows, columns]
    return window


def _error(fit: Fit, grid: Points, mask: np.ndarray) -> float:
    points = grid.at(mask)
    return float(rms(fit(points)(points)))

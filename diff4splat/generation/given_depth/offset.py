"""Where infinity is in inverse depth that is known up to a factor and an offset.

One number is missing: with another one flat scenes become deep, boxes oblique and balls eggs.

1. Sky. Many pixels with the smallest value, and few just above it, are sky: infinity is there.
2. Else the most probable offset. Inverse depth of images usually varies by about ``SPREAD`` of its
   mean, and that of the far end is about ``FAR_END`` of the median's: that is the prior. Planes
   stay planes and quadrics stay quadrics under any offset, but angles and roundness do not.
   Evidence are spheres, cylinders and planes that meet at right angles (``surfaces``), where the
   map is so precise that such surfaces explain most of it, and the share of perpendicular normals
   (``right_angles``) in any map.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.generation.given_depth.right_angles import right_angle_evidence
from diff4splat.generation.given_depth.surfaces.evidence import surface_evidence
from diff4splat.generation.given_depth.surfaces.points import grid_points
from diff4splat.generation.given_depth.surfaces.segments import covered_share, find_segments

SPREAD, SPREAD_SIGMA = 0.51, 0.4
"""Standard deviation over mean of inverse depth: the median of path-traced scenes without sky, and
the standard deviation of its logarithm."""
FAR_END, FAR_END_SIGMA = 0.55, 0.21
"""Inverse depth of the far end over the median's: mean and standard deviation in these scenes."""
CLEAR = 4.0
"""Evidence of right angles that counts; smooth objects have less under any offset."""
SKY_SHARE, SKY_GAP, LEVEL = 0.02, 4.0, 0.004
"""Least share of sky, how many times its pixels outnumber those of the next level, and the width of
a level as a share of the range: one of 8 bits."""
RELIEF = np.linspace(0.02, 0.97, 191)
"""Inverse depth of the far end against the median, one per offset that is tried."""
COARSE = slice(None, None, 3)
"""Of these, where the share of perpendicular normals is counted."""
PRECISE = 0.7
"""Share of a map that planes and quadrics explain, from which on their shapes count."""
CLEAR_NATS = 1.0
"""Evidence of surfaces that counts."""
LEAST_SIDE_PX = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset:
    """The value of the map at infinity."""

    infinity: float
    why: str


def find_offset(values: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]) -> Offset:
    """Of values (h, w), NaN where unknown; ``tangents`` are x/z of the columns and y/z of the rows.

    The far end and the median must differ; a map of one value has no offset.
    """
    known = values[np.isfinite(values)]
    if is_sky(values):
        return Offset(infinity=float(known.min()), why="sky is infinitely far")
    low, middle = np.quantile(known, [0.01, 0.5])
    span = float(np.ptp(known))
    offsets = low - RELIEF / (1 - RELIEF) * max(middle - low, 1e-3 * span)
    scaled, tried = (values - low) / span, (offsets - low) / span
    angles = _angles(scaled, tried, tangents)
    score = np.log(np.maximum(angles, CLEAR) * usual_prior(known, offsets))
    surfaces = _surfaces(scaled, tried, tangents)
    best = int(np.argmax(score + surfaces))
    if surfaces[best] > CLEAR_NATS:
        weights = np.exp(score + surfaces - (score + surfaces)[best])
        return Offset(infinity=_mean_near(offsets, weights, best), why="shapes of surfaces")
    if angles[best] > CLEAR:
        reach = COARSE.step
        weights = angles - 0.9 * angles[max(best - reach, 0) : best + reach + 1].min()
        return Offset(infinity=_mean_near(offsets, weights, best), why="right angles")
    return Offset(infinity=float(offsets[best]), why="usual spread")


def _angles(
    scaled: np.ndarray, tried: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Share of perpendicular normals, as evidence; 1 is none."""
    return np.interp(RELIEF, RELIEF[COARSE], right_angle_evidence(scaled, tried[COARSE], tangents))


def _surfaces(
    scaled: np.ndarray, tried: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Logarithm of evidence; 0 where the map is too coarse, or its surfaces are not precise."""
    if min(scaled.shape) < LEAST_SIDE_PX:
        return np.zeros(len(tried))
    grid = grid_points(scaled, tangents)
    segments = find_segments(grid)
    if covered_share(grid, segments) < PRECISE:
        return np.zeros(len(tried))
    return surface_evidence(grid, segments, tried)


def usual_prior(known: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """How usual inverse depth is with infinity at each of the offsets of ``RELIEF``; at most 1."""
    spread = known.std(dtype=np.float64) / (known.mean(dtype=np.float64) - offsets)
    deviation = np.log(spread / SPREAD) / SPREAD_SIGMA
    return np.exp(-0.5 * (deviation**2 + ((RELIEF - FAR_END) / FAR_END_SIGMA) ** 2))


def is_sky(values: np.ndarray) -> bool:
    """Whether the farthest pixels are sky: equal, many, and with a gap after them.

    A wall seen from the front has no gap: its values go on.
    """
    known = values[np.isfinite(values)]
    low, level = known.min(), LEVEL * np.ptp(known)
    count = int((known <= low + level / 2).sum())
    after = int((known <= low + 1.5 * level).sum()) - count
    return count >= SKY_SHARE * values.size and count >= SKY_GAP * after


def _mean_near(offsets: np.ndarray, weights: np.ndarray, best: int) -> float:
    """The peak between the offsets that were tried: their mean around the best one."""
    near = slice(max(best - COARSE.step, 0), best + COARSE.step + 1)
    return float(np.average(offsets[near], weights=np.maximum(weights[near], 0)))

"""Orders images of a grid of cameras into paths that a camera could fly.

Axes: ``n`` images, ``m`` of one path.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64, Int64

_SAME_DIRECTION_DEG = 15.0
_LONGEST_STEP = 1.5
"""Times the median step of a direction; more begins another path."""
_SHORTEST_PATH = 2


def grid_paths(
    world_from_camera: Float64[np.ndarray, "n 4 4"],
) -> Iterator[Int64[np.ndarray, " m"]]:
    """Indices of images with one viewing direction, each a step from the one before."""
    for group in _directions(world_from_camera[:, :3, :3]):
        order = _by_nearest(world_from_camera[group, :3, 3])
        path = group[order]
        steps = np.linalg.norm(np.diff(world_from_camera[path, :3, 3], axis=0), axis=1)
        if not len(steps):
            continue
        cuts = np.flatnonzero(steps > _LONGEST_STEP * np.median(steps)) + 1
        yield from (part for part in np.split(path, cuts) if len(part) >= _SHORTEST_PATH)


def _directions(rotations: Float64[np.ndarray, "n 3 3"]) -> list[np.ndarray]:
    """Indices by rotation: each group within a few degrees of its first member."""
    least = 1 + 2 * np.cos(np.radians(_SAME_DIRECTION_DEG))
    left, groups = np.arange(len(rotations)), []
    while len(left):
        trace = np.einsum("ij,nij->n", rotations[left[0]], rotations[left])
        near = trace >= least - 1e-12
        groups.append(left[near])
        left = left[~near]
    return groups


def _by_nearest(places: Float64[np.ndarray, "n 3"]) -> np.ndarray:
    """From the first place always to the nearest that is left."""
    left, order = np.ones(len(places), bool), [0]
    left[0] = False
    for _ in range(len(places) - 1):
        away = np.where(left, ((places - places[order[-1]]) ** 2).sum(1), np.inf)
        order.append(int(away.argmin()))
        left[order[-1]] = False
    return np.array(order)

"""Rays that look the same way from about the same place, sixty-four at a time.

Axes: ``r`` rays. Rays are sorted by where they start (in cells that are coarse next to the scene)
and then along Hilbert's curve over the octahedral map of directions, and cut into packets that stay
within a cone, because float32 is relative to the size of a packet.
"""

import numpy as np

from diff4splat.render.raster.footprint import triple
from diff4splat.render.raster.jit import exact
from diff4splat.render.raster.threads import ranges, spread
from diff4splat.render.trace.compiled import kernel
from diff4splat.render.trace.frame import PACKET, dot, minus
from diff4splat.render.trace.sorting import hilbert, sorted_order
from diff4splat.render.trace.tables import Bundle, Floats

_DEPTH, _CELL_DEPTH = 14, 8
_CELLS = 16
"""Cells of origins along that size."""
_APART = 2.0
"""How many cells the first and any other ray of a packet may start apart."""
_CONE = 0.9
"""Least cosine between the first and any other ray of a packet."""
_RAYS_PER_PART = 4096


def bundle_rays(origins: Floats, directions: Floats, times: Floats, size: float) -> Bundle:
    """Packets of rays; ``size`` is how large and how far away the scene is."""
    keys, count = np.empty(len(origins), np.uint64), len(origins)

    def work(first: int, last: int) -> None:
        ray_keys(first, last, origins, directions, _CELLS / size, keys)

    spread(work, ranges(count, _RAYS_PER_PART))
    order = sorted_order(keys)
    starts = np.empty(count + 1, np.int64)
    packets = cut(order, origins, directions, (_APART * size / _CELLS) ** 2, starts)
    return Bundle(origins, directions, times, order, starts[: packets + 1])


@kernel
def ray_keys(first, last, origins, directions, cells_per_unit, keys):
    """Cell of the origin above place of the direction, of rays ``first`` to ``last``."""
    corner, base = np.empty(3, np.int64), triple(origins, 0)
    side = 1 << _CELL_DEPTH
    for ray in range(first, last):
        origin = triple(origins, ray)
        for axis in range(3):
            # Rounded, so that origins close to the first one share its cell.
            cell = (origin[axis] - base[axis]) * cells_per_unit
            corner[axis] = int(min(max(np.rint(cell), -side / 2), side / 2 - 1)) + side // 2
        cell = hilbert(corner, 3, _CELL_DEPTH)
        x, y = _octahedral(triple(directions, ray))
        side_of_map = 1 << _DEPTH
        corner[0] = min(int(x * side_of_map), side_of_map - 1)
        corner[1] = min(int(y * side_of_map), side_of_map - 1)
        keys[ray] = np.uint64((cell << (2 * _DEPTH)) | hilbert(corner, 2, _DEPTH))


@exact
def _octahedral(direction):
    """A unit direction to the unit square: the octahedron |x| + |y| + |z| = 1, folded out."""
    x, y, z = direction
    size = abs(x) + abs(y) + abs(z)
    u, v = x / size, y / size
    if z < 0:
        u, v = (1 - abs(v)) * (1 if u >= 0 else -1), (1 - abs(u)) * (1 if v >= 0 else -1)
    return 0.5 * u + 0.5, 0.5 * v + 0.5


@kernel
def cut(order, origins, directions, squared_apart, starts):
    """Where packets begin in ``order``, and its length behind them; returns how many there are."""
    count, first = 0, 0
    for place in range(len(order)):
        if place - first == PACKET or _parts(
            origins, directions, order[first], order[place], squared_apart
        ):
            first = place
        if place == first:
            starts[count] = place
            count += 1
    starts[count] = len(order)
    return count


@exact
def _parts(origins, directions, one, other, squared_apart):
    """Whether two rays look too different ways, or from places too far apart."""
    away = minus(triple(origins, one), triple(origins, other))
    turn = dot(triple(directions, one), triple(directions, other))
    return turn < _CONE or dot(away, away) > squared_apart

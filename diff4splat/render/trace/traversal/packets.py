"""Packets of at most sixty-four rays with similar origins and directions.

Axes: ``r`` rays. Rays are sorted by the cell that they start in (see `ray_binning`) and then along
Hilbert's curve over the octahedral map of directions, and cut into packets that stay within a cone,
because float32 is relative to the size of a packet.
"""

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster.projection.footprint import triple
from diff4splat.render.trace.bvh.radix_sort import hilbert, sorted_order
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.tables import Floats, RayBundle
from diff4splat.render.trace.traversal.frame import PACKET, dot, minus
from diff4splat.render.trace.traversal.ray_binning import bin_of, choose_bins, octahedral

_DEPTH = 14
_LARGEST_CELL = 1 / 16
"""Next to the scene."""
_APART = 2.0
"""How many such cells the first and any other ray of a packet may start apart."""
_CONE = 0.9
"""Least cosine between the first and any other ray of a packet."""
_RAYS_PER_PART = 4096


def bundle_rays(
    origins: Floats, directions: Floats, times: Floats, size: float, distance: float
) -> RayBundle:
    """Packets of rays.

    ``size`` is how large and how far away the scene is, ``distance`` how far away most of it is.
    """
    keys, count, largest = np.empty(len(origins), np.uint64), len(origins), _LARGEST_CELL * size
    if count:
        cells = choose_bins(origins, directions, largest, distance)

    def work(first: int, last: int) -> None:
        ray_keys(first, last, origins, directions, cells, keys)

    parallel_for(work, ranges(count, _RAYS_PER_PART))
    order = sorted_order(keys)
    starts = np.empty(count + 1, np.int64)
    packets = cut(order, origins, directions, (_APART * largest) ** 2, starts)
    return RayBundle(origins, directions, times, order, starts[: packets + 1])


@kernel
def ray_keys(first, last, origins, directions, cells, keys):
    """Cell of the origin above place of the direction, of rays ``first`` to ``last``."""
    corner, side = np.empty(2, np.int64), 1 << _DEPTH
    for ray in range(first, last):
        cell = bin_of(cells, triple(origins, ray))
        x, y = octahedral(triple(directions, ray))
        corner[0] = min(int(x * side), side - 1)
        corner[1] = min(int(y * side), side - 1)
        place = hilbert(corner, 2, _DEPTH)
        # Alternate the direction, so that packets across two cells have similar directions.
        place = side * side - 1 - place if cell & 1 else place
        keys[ray] = np.uint64((cell << (2 * _DEPTH)) | place)


@kernel
def cut(order, origins, directions, squared_apart, starts):
    """Write where packets begin in ``order``, then its length; returns the number of packets."""
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


@inlined
def _parts(origins, directions, one, other, squared_apart):
    """Whether the directions or origins of two rays are too far apart."""
    away = minus(triple(origins, one), triple(origins, other))
    turn = dot(triple(directions, one), triple(directions, other))
    return turn < _CONE or dot(away, away) > squared_apart

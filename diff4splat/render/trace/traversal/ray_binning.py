"""Binning of rays by origin: how far apart the origins and directions of a packet may be.

Axes: ``s`` rays that were picked. The rays of one cell are cut by direction into packets of P. With
cells of sides c, N rays, and solid angles that the rays of each cell fill and that are A in sum,
the beam of a packet is about

    Σ c / 2 + d √(P A / N)

wide at distance d (rays go along one of three sides, and across two). In smaller cells fewer rays
have similar directions, so A grows: over the area of a lens as 1 / c², along a path as 1 / c. A
pinhole has one cell.

Both are estimated from a sample of the rays, sorted by cell and part of the field. A is the number
of such pairs over the share of them in the sample, which is one less the share of rays alone in
their pair (Good,
"The population frequencies of species and the estimation of population parameters", Biometrika
1953). Sides are those of a box with the variance of origins within pairs: where a
shutter rolls, rays of similar direction have similar origins anyway.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff4splat.kernels.jit import inlined
from diff4splat.render.raster.projection.footprint import triple
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.tables import Doubles, Floats
from diff4splat.render.trace.traversal.frame import PACKET

_MOST_PARTS = 1 << 8
"""Of the box along each axis."""
_SAMPLED = 4096
_GOLDEN = 0.6180339887498949
_HALVINGS = 10
_POINT = 1e-5
"""Origins that are no further apart, next to the distance, are one."""
_DIRECTION_PARTS = 8
"""Parts of the directions along each axis of their map, to estimate their solid angle."""


class RayBins(NamedTuple):
    """The oriented box of the origins, cut into equal cells."""

    base: Doubles
    """One of the origins."""
    axes: Doubles
    """3 × 3, row by row, orthonormal."""
    lower: Doubles
    """Corner of the box along these axes, from the base."""
    per_unit: Doubles
    """Cells per unit along each axis; 0 where there is one."""
    counts: NDArray[np.int64]


def choose_bins(origins: Floats, directions: Floats, size: float, distance: float) -> RayBins:
    """The cells whose packets are narrowest at ``distance``, none wider than ``size``."""
    picked = _spread_out(len(origins))
    base = origins[0].astype(np.float64)
    places = origins[picked] - base
    axes = np.linalg.eigh(places.T @ places)[1].T
    along = places @ axes.T
    box = _Box(base, axes, *_edges(along))
    width, least, chosen = min(float(box.extent.max()), size), math.inf, _cut(box, size)
    if width < _POINT * distance:
        return chosen
    mapped = np.empty((len(picked), 2))
    map_directions(directions, picked, mapped)
    for _ in range(_HALVINGS):
        bins = _cut(box, width)
        field, side = _measured(bins, along, mapped)
        beam = 0.5 * side / distance + math.sqrt(PACKET * field / len(origins))
        if beam >= least:
            break
        least, chosen, width = beam, bins, 0.5 * width
    return chosen


class _Box(NamedTuple):
    base: Doubles
    axes: Doubles
    lower: Doubles
    extent: Doubles


def _spread_out(count: int) -> NDArray[np.int64]:
    """Some of ``count`` rays, in step with nothing: samples of pixels repeat."""
    if count <= _SAMPLED:
        return np.arange(count)
    return (np.arange(_SAMPLED) * _GOLDEN % 1.0 * count).astype(np.int64)


def _edges(places: Doubles) -> tuple[Doubles, Doubles]:
    lower = places.min(0)
    return lower, places.max(0) - lower


def _cut(box: _Box, width: float) -> RayBins:
    """Equal parts of at most ``width``."""
    parts = np.ones(3)
    if width > 0:
        parts = np.ceil(box.extent / width * (1 - 1e-9)).clip(1, _MOST_PARTS)
    per_unit = np.where(parts > 1, parts / np.where(parts > 1, box.extent, 1.0), 0.0)
    return RayBins(box.base, box.axes, box.lower, per_unit, parts.astype(np.int64))


def _measured(cells: RayBins, along: Doubles, mapped: Doubles) -> tuple[float, float]:
    """Solid angles summed over cells, and the sum of the sides; infinite where rays do not tell."""
    lower, extent = _edges(mapped)
    part = np.where(extent > 0, extent, 1.0) / _DIRECTION_PARTS
    direction_part = np.minimum(((mapped - lower) / part).astype(np.int64), _DIRECTION_PARTS - 1)
    at = np.minimum(((along - cells.lower) * cells.per_unit).astype(np.int64), cells.counts - 1)
    keys = np.ravel_multi_index(
        (*at.T, *direction_part.T), (*cells.counts, _DIRECTION_PARTS, _DIRECTION_PARTS)
    )
    _, pair, rays = np.unique(keys, return_inverse=True, return_counts=True)
    coverage = 1 - (rays == 1).sum() / len(keys)
    if coverage <= 0:
        return math.inf, math.inf
    solid_angle = len(rays) / coverage * 4 * math.pi * float(part.prod())
    within = 0.0
    for axis in along.T:
        means = np.bincount(pair, axis) / rays
        variance = ((axis - means[pair]) ** 2).sum() / (len(keys) - len(rays))
        within += math.sqrt(12 * variance)
    return solid_angle, within


@kernel
def map_directions(directions, picked, mapped):
    """Places of some directions in the unit square."""
    for place in range(len(picked)):
        mapped[place] = octahedral(triple(directions, picked[place]))


@inlined
def bin_of(cells, origin):
    """Number of an origin's cell; what lies outside the box belongs to the nearest.

    There and back along rows and layers, so that numbers that follow each other are neighbours.
    """
    layer, row, place = _part(cells, origin, 0), _part(cells, origin, 1), _part(cells, origin, 2)
    rank = layer * cells.counts[1] + (cells.counts[1] - 1 - row if layer & 1 else row)
    return rank * cells.counts[2] + (cells.counts[2] - 1 - place if rank & 1 else place)


@inlined
def _part(cells, origin, axis):
    """Which part of the box along one axis."""
    x, y, z = origin[0] - cells.base[0], origin[1] - cells.base[1], origin[2] - cells.base[2]
    along = cells.axes[axis, 0] * x + cells.axes[axis, 1] * y + cells.axes[axis, 2] * z
    part = (along - cells.lower[axis]) * cells.per_unit[axis]
    return int(min(max(part, 0.0), float(cells.counts[axis] - 1)))


@inlined
def octahedral(direction):
    """A unit direction to the unit square: the octahedron |x| + |y| + |z| = 1, folded out."""
    x, y, z = direction
    size = abs(x) + abs(y) + abs(z)
    u, v = x / size, y / size
    if z < 0:
        u, v = (1 - abs(v)) * (1 if u >= 0 else -1), (1 - abs(u)) * (1 if v >= 0 else -1)
    return 0.5 * u + 0.5, 0.5 * v + 0.5

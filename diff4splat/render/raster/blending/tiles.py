"""Kernels: lists of the Gaussians that overlap each tile, by a counting sort over tiles.

A Gaussian is on the list of a tile when the ellipse where its opacity reaches the cutoff meets the
rectangle of the tile's pixel centres. Row by row of tiles this is exact: the ellipse cut by a band
is convex, so its columns are an interval. Ranks are handled in pieces, each with its own count per
tile, so that every list comes out nearest first whatever the number of pieces.
"""

import math

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd_memory import prefetch
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.tables import (
    CENTER_X,
    CENTER_Y,
    EXTENT_X,
    EXTENT_Y,
    SHEAR,
    WHITEN_X,
    WHITEN_Y,
)

_AHEAD = 16
"""How many Gaussians ahead footprints are fetched; they lie in memory in any order."""


@kernel
def count_pairs(first, last, order, prints, grid, counts):
    """Add 1 to ``counts`` of each tile that a Gaussian of ranks ``first`` to ``last`` touches."""
    for rank in range(first, last):
        prefetch(prints, order[min(rank + _AHEAD, last - 1)])
        index = order[rank]
        left, top, right, bottom = pixel_box(prints, index, grid.width, grid.height)
        for tile_row in range(top >> grid.shift, (bottom >> grid.shift) + 1):
            start, stop = _columns(prints, index, tile_row, (left, top, right, bottom), grid)
            for column in range(start, stop + 1):
                counts[tile_row * grid.columns + column] += 1


@kernel
def fill_lists(first, last, order, prints, grid, region, cursors, slot, first_slots, lists):
    """Write the Gaussians of these ranks into the lists of the tiles in ``region``.

    ``cursors`` says where the next entry of each tile goes, ``slot`` the number of the first pair.
    """
    for rank in range(first, last):
        prefetch(prints, order[min(rank + _AHEAD, last - 1)])
        first_slots[rank] = slot
        index = order[rank]
        left, top, right, bottom = pixel_box(prints, index, grid.width, grid.height)
        low = max(top >> grid.shift, region[0])
        for tile_row in range(low, min(bottom >> grid.shift, region[1] - 1) + 1):
            start, stop = _columns(prints, index, tile_row, (left, top, right, bottom), grid)
            for column in range(max(start, region[2]), min(stop, region[3] - 1) + 1):
                tile = tile_row * grid.columns + column
                lists.members[cursors[tile]] = index
                lists.slots[cursors[tile]] = slot
                cursors[tile] += 1
                slot += 1


@kernel
def place_lists(counts, starts):
    """Turn ``counts`` (pieces × tiles) into the first position of each, and fill ``starts``."""
    running = 0
    for tile in range(counts.shape[1]):
        starts[tile] = running
        for piece in range(counts.shape[0]):
            size = counts[piece, tile]
            counts[piece, tile] = running
            running += size
    starts[counts.shape[1]] = running


@inlined
def pixel_box(prints, i, width, height):
    """(left, top, right, bottom), inclusive, of the pixel centres in the box of a footprint."""
    x, y = prints[i, CENTER_X], prints[i, CENTER_Y]
    extent_x, extent_y = prints[i, EXTENT_X], prints[i, EXTENT_Y]
    return (
        np.int64(max(np.ceil(x - extent_x - 0.5), 0.0)),
        np.int64(max(np.ceil(y - extent_y - 0.5), 0.0)),
        np.int64(min(np.floor(x + extent_x - 0.5), width - 1.0)),
        np.int64(min(np.floor(y + extent_y - 0.5), height - 1.0)),
    )


@inlined
def _columns(prints, i, tile_row, box, grid):
    """First and last column of tiles that a footprint touches in a row of tiles."""
    shift = grid.shift
    left, top, right, bottom = box
    # The ellipse lies in one row or one column of tiles: the box is exact.
    if top >> shift == bottom >> shift or left >> shift == right >> shift:
        return left >> shift, right >> shift
    start, stop = _interval(prints, i, (tile_row << shift) + 0.5, ((tile_row + 1) << shift) - 0.5)
    return (
        max(np.int64(max(np.ceil(start - 0.5), 0.0)), left) >> shift,
        min(np.int64(min(np.floor(stop - 0.5), grid.width - 1.0)), right) >> shift,
    )


@inlined
def _interval(prints, i, above, below):
    """The x that the ellipse of a footprint covers between two heights."""
    a, k, b = prints[i, WHITEN_X], prints[i, SHEAR], prints[i, WHITEN_Y]
    extent, x, y = prints[i, EXTENT_X], prints[i, CENTER_X], prints[i, CENTER_Y]
    # u² + v² of the ellipse, and the height at which it is widest.
    level, widest = (extent * a) ** 2, extent * k / b
    above, below = above - y, below - y
    right = _edge(min(max(widest, above), below), a, k, b, level, 1.0)
    left = _edge(min(max(-widest, above), below), a, k, b, level, -1.0)
    return x + left, x + right


@inlined
def _edge(dy, a, k, b, level, side):
    """The dx where (a dx)² + (b dy - k dx)² is ``level``, on one side."""
    whole = a * a + k * k
    rest = level * whole - (a * b * dy) ** 2
    return (b * k * dy + side * math.sqrt(max(rest, 0.0))) / whole

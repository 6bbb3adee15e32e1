"""The stages of a picture, each spread over threads in parts that do not depend on their number.

project → sort by depth → colours → lists per tile → blend, and the same backwards. A picture with
more pairs (tile, Gaussian) than may be kept is cut into regions of tiles that are done one after
another; on the way back their lists are made again.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from diff4splat.render.raster import harmonics, project
from diff4splat.render.raster.order import nearest_first
from diff4splat.render.raster.tables import (
    Cloud,
    Doubles,
    Floats,
    Grid,
    Integers,
    Lists,
    Rules,
    View,
)
from diff4splat.render.raster.threads import ranges, spread
from diff4splat.render.raster.tiles import count_pairs, fill_lists, place_lists

_PART = 4096
"""Gaussians in one part."""
_TILES = 8
"""Tiles in one part, and pieces of the depth order: each has its own count per tile."""
_PIECES = 8

Region = tuple[int, int, int, int]
"""Rows of tiles from the first to before the second, then columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprints:
    """What projection leaves: rows are valid for the Gaussians in ``order`` only."""

    prints: Doubles
    depth: Floats
    order: Integers
    """Visible ones, nearest first."""
    unusable: NDArray[np.int64]
    """Gaussians left out, by the first parameter that is not finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binned:
    """How many pairs there are, and the lists of one region."""

    counts: Integers
    """pieces × tiles."""
    regions: list[Region]


def empty(*shape: int, dtype: torch.dtype = torch.float32) -> np.ndarray:
    """An array that begins on a cache line, as PyTorch's do."""
    return torch.empty(shape, dtype=dtype).numpy()


def project_cloud(cloud: Cloud, sh: Floats, view: View, rules: Rules) -> Footprints:
    """Footprints and their depth order."""
    count = len(cloud.means)
    prints, depth = empty(count, 8, dtype=torch.float64), empty(count)
    visible, parts = empty(count, dtype=torch.int32), ranges(count, _PART)
    found, unusable = [0] * len(parts), np.zeros((len(parts), project.SH + 1), np.int64)
    flat = sh.reshape(count, -1)

    def work(number: int, first: int, last: int) -> None:
        found[number] = project.project(
            first, last, cloud, flat, view, rules, prints, depth, visible, unusable[number]
        )

    spread(work, ((number, *part) for number, part in enumerate(parts)))
    kept = [visible[first : first + size] for (first, _), size in zip(parts, found, strict=True)]
    listed = np.concatenate([visible[:0], *kept])
    order = nearest_first(listed, depth)
    return Footprints(prints=prints, depth=depth, order=order, unusable=unusable.sum(0))


def color(cloud: Cloud, sh: Floats, view: View, order: Integers, values: Floats) -> None:
    """RGB of visible Gaussians into the first three columns of ``values``."""
    spread(
        lambda first, last: harmonics.colors(
            first, last, order, cloud.means, sh, view.position, values
        ),
        ranges(len(order), _PART),
    )


def bin_footprints(found: Footprints, grid: Grid, pair_limit: int) -> Binned:
    """Pairs per tile, and regions of at most ``pair_limit`` pairs or one tile."""
    pieces = _pieces(found.order)
    counts = np.zeros((len(pieces), grid.columns * grid.rows), np.int32)
    spread(
        lambda number, first, last: count_pairs(
            first, last, found.order, found.prints, grid, counts[number]
        ),
        ((number, *piece) for number, piece in enumerate(pieces)),
    )
    per_tile = counts.sum(0, dtype=np.int64).reshape(grid.rows, grid.columns)
    regions = list(_split((0, grid.rows, 0, grid.columns), per_tile, pair_limit))
    return Binned(counts=counts, regions=regions)


def lists_of(
    found: Footprints, grid: Grid, binned: Binned, region: Region
) -> tuple[Lists, NDArray[np.int64]]:
    """The lists of the tiles in ``region``, and the first slot of every rank (one more at last)."""
    mask = np.zeros((grid.rows, grid.columns), np.int32)
    mask[region[0] : region[1], region[2] : region[3]] = 1
    cursors = binned.counts * mask.reshape(-1)
    first_slots = np.zeros(len(found.order) + 1, np.int64)
    piece_slots = np.concatenate([[0], cursors.sum(1, dtype=np.int64).cumsum()])
    starts = np.empty(mask.size + 1, np.int64)
    cursors = cursors.astype(np.int64)
    place_lists(cursors, starts)
    lists = Lists(starts, np.empty(starts[-1], np.int32), np.empty(starts[-1], np.int32))
    first_slots[-1] = starts[-1]
    bounds = np.array(region)
    spread(
        lambda number, first, last: fill_lists(
            first,
            last,
            found.order,
            found.prints,
            grid,
            bounds,
            cursors[number],
            piece_slots[number],
            first_slots,
            lists,
        ),
        ((number, *piece) for number, piece in enumerate(_pieces(found.order))),
    )
    return lists, first_slots


def tiles_of(region: Region, grid: Grid) -> list[tuple[NDArray[np.int64]]]:
    """Numbers of the tiles of a region, in parts."""
    rows, columns = np.mgrid[region[0] : region[1], region[2] : region[3]]
    tiles = (rows * grid.columns + columns).reshape(-1)
    return [(tiles[first:last],) for first, last in ranges(len(tiles), _TILES)]


def _pieces(order: Integers) -> list[tuple[int, int]]:
    return ranges(len(order), max(_PART, -(-len(order) // _PIECES)))


def _split(region: Region, per_tile: np.ndarray, limit: int) -> Iterator[Region]:
    """Halve the longer side of ``region`` until it is small enough."""
    top, bottom, left, right = region
    if per_tile[top:bottom, left:right].sum() <= limit or (bottom - top, right - left) == (1, 1):
        yield region
    elif bottom - top >= right - left:
        middle = (top + bottom) // 2
        yield from _split((top, middle, left, right), per_tile, limit)
        yield from _split((middle, bottom, left, right), per_tile, limit)
    else:
        middle = (left + right) // 2
        yield from _split((top, bottom, left, middle), per_tile, limit)
        yield from _split((top, bottom, middle, right), per_tile, limit)

"""The forward pass: project → sort by depth → colours → lists of tiles → blend.

Every stage is spread over threads in parts whose results do not depend on which thread does them.
An image with more pairs (tile, Gaussian) than may be kept is cut into regions of tiles that are
done one after another.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster.blending.blend import FIXED, blend
from diff4splat.render.raster.blending.depth_sort import depth_sort
from diff4splat.render.raster.blending.tiles import count_pairs, fill_lists, place_lists
from diff4splat.render.raster.padded_image import PaddedImage, empty
from diff4splat.render.raster.projection.harmonics import colors
from diff4splat.render.raster.projection.project import SH, project
from diff4splat.render.raster.raster_settings import RasterSettings
from diff4splat.render.raster.tables import (
    Cloud,
    Doubles,
    Floats,
    Grid,
    Integers,
    Lists,
    ProjectionInputs,
    ProjectionOutputs,
    View,
)

GAUSSIANS_PER_PART = 4096
TILES_PER_PART = 4
_PIECES = 8
"""Pieces of the depth order at most; each needs its own count per tile."""

Region = tuple[int, int, int, int]
"""Rows of tiles from the first to before the second, then columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprints:
    """What projection leaves; rows are valid for the Gaussians in ``order`` only."""

    prints: Doubles
    depth: Floats
    visible: Integers
    """In increasing order: work on every one of them reads memory in a line."""
    order: Integers
    """The same, nearest first."""
    unusable: NDArray[np.int64]
    """Gaussians left out, by the first parameter that is not finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binned:
    """How many pairs every tile has, and the regions to do one after another."""

    counts: Integers
    """pieces × tiles."""
    regions: list[Region]


@dataclass(frozen=True, slots=True, kw_only=True)
class Filled:
    """The lists of the tiles in a region."""

    region: Region
    lists: Lists
    first_slots: NDArray[np.int64]
    """First slot of every rank, and one more: how many slots there are."""


def footprints(cloud: Cloud, sh: Floats, view: View, plan: RasterSettings) -> Footprints:
    """Project all Gaussians and sort the visible ones."""
    count = len(cloud.means)
    prints, depth = empty(count, 8, dtype=torch.float64), empty(count)
    everyone = np.arange(count, dtype=np.int32)
    numbers, unusable = sh.reshape(count, sh.shape[1] * 3), np.zeros(SH + 1, np.int64)
    inputs = ProjectionInputs(cloud, numbers, view, plan.rules)

    def work(first: int, last: int, visible: Integers, faults: NDArray[np.int64]) -> int:
        outputs = ProjectionOutputs(prints, depth, visible, faults)
        return project(first, last, everyone, inputs, outputs)

    visible = list_visible(count, work, unusable)
    order = depth_sort(visible, depth)
    return Footprints(prints=prints, depth=depth, visible=visible, order=order, unusable=unusable)


def list_visible(
    count: int, work: Callable[[int, int, Integers, NDArray[np.int64]], int], unusable: np.ndarray
) -> Integers:
    """Those of ``count`` candidates that ``work`` lists, in their order; adds to ``unusable``."""
    visible, parts = empty(count, dtype=torch.int32), ranges(count, GAUSSIANS_PER_PART)
    found, faults = [0] * len(parts), np.zeros((len(parts), SH + 1), np.int64)

    def part_work(part: int, first: int, last: int) -> None:
        found[part] = work(first, last, visible, faults[part])

    parallel_for(part_work, numbered(parts))
    unusable += faults.sum(0)
    kept = [visible[first : first + size] for (first, _), size in zip(parts, found, strict=True)]
    return np.concatenate([visible[:0], *kept])


def channel_table(
    plan: RasterSettings, cloud: Cloud, sh: Floats, extras: Floats, view: View, visible: Integers
) -> Floats:
    """Per Gaussian: RGB if it is asked for, the extra channels, zeros up to the fixed number."""
    start = 3 if plan.colors else 0
    stop = start + extras.shape[1]
    values = empty(len(sh), max(stop, FIXED))
    values[:, start:stop] = extras
    values[:, stop:] = 0
    if plan.colors:

        def work(first: int, last: int) -> None:
            colors(first, last, visible, cloud.means, sh, view.position, values)

        parallel_for(work, ranges(len(visible), GAUSSIANS_PER_PART))
    return values


def bin_footprints(projected: Footprints, plan: RasterSettings) -> Binned:
    """Count pairs, and cut the image into regions of few enough of them or one tile."""
    grid, pieces = plan.grid, _pieces(projected.order)
    counts = np.zeros((len(pieces), grid.rows * grid.columns), np.int32)

    def work(piece: int, first: int, last: int) -> None:
        count_pairs(first, last, projected.order, projected.prints, grid, counts[piece])

    parallel_for(work, numbered(pieces))
    per_tile = counts.sum(0, dtype=np.int64).reshape(grid.rows, grid.columns)
    regions = _split((0, grid.rows, 0, grid.columns), per_tile, plan.pair_limit)
    return Binned(counts=counts, regions=list(regions))


def fill_region(projected: Footprints, grid: Grid, binned: Binned, region: Region) -> Filled:
    """The lists of the tiles in ``region``."""
    top, bottom, left, right = region
    cursors = np.zeros((len(binned.counts), grid.rows, grid.columns), np.int64)
    counts = binned.counts.reshape(cursors.shape)
    cursors[:, top:bottom, left:right] = counts[:, top:bottom, left:right]
    cursors = cursors.reshape(len(cursors), grid.rows * grid.columns)
    first_slot = np.concatenate([[0], cursors.sum(1).cumsum()])
    starts = np.empty(grid.rows * grid.columns + 1, np.int64)
    place_lists(cursors, starts)
    pairs = int(starts[-1])
    lists = Lists(starts, empty(pairs, dtype=torch.int32), empty(pairs, dtype=torch.int32))
    first_slots = np.empty(len(projected.order) + 1, np.int64)
    first_slots[-1] = pairs

    def work(piece: int, first: int, last: int) -> None:
        fill_lists(
            first, last, projected.order, projected.prints, grid, np.array(region), cursors[piece],
            first_slot[piece], first_slots, lists,
        )  # fmt: skip

    parallel_for(work, numbered(_pieces(projected.order)))
    return Filled(region=region, lists=lists, first_slots=first_slots)


def blend_region(
    plan: RasterSettings, filled: Filled, projected: Footprints, values: Floats, image: PaddedImage
) -> None:
    """Blend the tiles of a region into ``image``."""
    tiles = tiles_of(filled.region, plan.grid)
    blend_tiles(plan, tiles, filled.lists, projected.prints, values, image)


def blend_tiles(
    plan: RasterSettings,
    tiles: NDArray[np.int64],
    lists: Lists,
    prints: Doubles,
    values: Floats,
    image: PaddedImage,
) -> None:
    """Blend some tiles into ``image``."""

    def work(first: int, last: int) -> None:
        blend(
            tiles[first:last], plan.grid, lists, prints, values, plan.rules, image.planes,
            image.light, image.stops, image.medians,
        )  # fmt: skip

    parallel_for(work, ranges(len(tiles), TILES_PER_PART))


def tiles_of(region: Region, grid: Grid) -> NDArray[np.int64]:
    """Numbers of the tiles of a region."""
    rows, columns = np.mgrid[region[0] : region[1], region[2] : region[3]]
    return (rows * grid.columns + columns).reshape(-1)


def numbered(parts: list[tuple[int, int]]) -> Iterator[tuple[int, int, int]]:
    """(number, first, last) of every part."""
    return ((number, *part) for number, part in enumerate(parts))


def _pieces(order: Integers) -> list[tuple[int, int]]:
    return ranges(len(order), max(GAUSSIANS_PER_PART, -(-len(order) // _PIECES)))


def _split(region: Region, per_tile: NDArray[np.int64], limit: int) -> Iterator[Region]:
    """Halve the longer side of ``region`` until it is small enough."""
    top, bottom, left, right = region
    height, width = bottom - top, right - left
    if per_tile[top:bottom, left:right].sum() <= limit or height == width == 1:
        yield region
    elif height >= width:
        middle = (top + bottom) // 2
        yield from _split((top, middle, left, right), per_tile, limit)
        yield from _split((middle, bottom, left, right), per_tile, limit)
    else:
        middle = (left + right) // 2
        yield from _split((top, bottom, left, middle), per_tile, limit)
        yield from _split((top, bottom, middle, right), per_tile, limit)

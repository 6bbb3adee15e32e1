"""Lists of Gaussians per square tile, cut into batches that fit in memory.

Axes: ``n`` Gaussians in depth order, ``p`` pairs (tile, Gaussian), ``b`` tiles of a batch, ``l``
list length, ``r c`` rows and columns of tiles. Boxes are half-open (left, top, right, bottom). The
image is cut into rectangular regions of tiles with a bounded number of pairs; inside a region
tiles with lists of similar length are padded to one length and handled together. Only integers live
here, so nothing depends on the order of threads.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Int
from torch import Tensor

Region = tuple[int, int, int, int]
"""(left, top, right, bottom) in tiles."""

_LEAST_FILL = 0.75
"""A batch holds no list shorter than this part of its longest one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TileBatch:
    """Tiles whose lists are padded to one length."""

    tiles: Int[Tensor, " b"]
    """Row-major numbers of the tiles in the image."""
    members: Int[Tensor, "b l"]
    """The Gaussians of each tile, nearest first, then padding with the number n."""


def grid_size(size_px: tuple[int, int], tile_px: int) -> tuple[int, int]:
    """(rows, columns) of the tiles that cover an image."""
    return -(-size_px[0] // tile_px), -(-size_px[1] // tile_px)


def tile_boxes(pixel_boxes: Int[Tensor, "n 4"], tile_px: int) -> Int[Tensor, "n 4"]:
    """The tiles that boxes of pixels touch."""
    start, stop = pixel_boxes[:, :2] // tile_px, -(-pixel_boxes[:, 2:] // tile_px)
    return torch.cat([start, stop], 1)


def regions(boxes: Int[Tensor, "n 4"], grid: tuple[int, int], limit: int) -> list[Region]:
    """Rectangles that cover the grid, each with at most ``limit`` pairs or one tile."""
    totals = _pair_totals(boxes, grid)
    return list(_split((0, 0, grid[1], grid[0]), totals, limit))


def batches(
    boxes: Int[Tensor, "n 4"], region: Region, columns: int, batch_pairs: int
) -> list[TileBatch]:
    """The lists of a region; ``batch_pairs`` bounds b · l unless one list alone is longer.

    ``columns`` is the number of tiles in a row of the image. Empty tiles are left out.
    """
    pair_tile, pair_member = _pairs(boxes, region, columns)
    pair_tile, order = pair_tile.sort(stable=True)
    members = torch.cat([pair_member[order], order.new_tensor([len(boxes)])])
    tiles, lengths = pair_tile.unique_consecutive(return_counts=True)
    first = lengths.cumsum(0) - lengths
    longest_first = lengths.argsort(descending=True, stable=True)
    tiles, lengths, first = tiles[longest_first], lengths[longest_first], first[longest_first]
    return [
        TileBatch(tiles=tiles[part], members=_padded(members, first[part], lengths[part]))
        for part in _similar(lengths.tolist(), batch_pairs)
    ]


def _pair_totals(boxes: Int[Tensor, "n 4"], grid: tuple[int, int]) -> Int[Tensor, "r c"]:
    """Summed-area table: entry (r, c) counts the pairs in tiles above r and left of c."""
    rows, columns = grid[0] + 1, grid[1] + 1
    left, top, right, bottom = boxes.unbind(1)

    def corners(row: Tensor, column: Tensor) -> Tensor:
        return torch.bincount(row * columns + column, minlength=rows * columns)

    edges = (
        corners(top, left) - corners(top, right) - corners(bottom, left) + corners(bottom, right)
    )
    pairs = edges.view(rows, columns).cumsum(0).cumsum(1)[:-1, :-1]
    return torch.nn.functional.pad(pairs, (1, 0, 1, 0)).cumsum(0).cumsum(1).cpu()


def _split(region: Region, totals: Int[Tensor, "r c"], limit: int) -> Iterator[Region]:
    """Halve ``region``, by rows while there are several, until it is small enough."""
    left, top, right, bottom = region
    pairs = totals[bottom, right] - totals[top, right] - totals[bottom, left] + totals[top, left]
    if int(pairs) <= limit or (right - left, bottom - top) == (1, 1):
        yield region
    elif bottom - top > 1:
        middle = (top + bottom) // 2
        yield from _split((left, top, right, middle), totals, limit)
        yield from _split((left, middle, right, bottom), totals, limit)
    else:
        middle = (left + right) // 2
        yield from _split((left, top, middle, bottom), totals, limit)
        yield from _split((middle, top, right, bottom), totals, limit)


def _pairs(
    boxes: Int[Tensor, "n 4"], region: Region, columns: int
) -> tuple[Int[Tensor, " p"], Int[Tensor, " p"]]:
    """(tile, Gaussian) of every pair in ``region``, nearest Gaussian first."""
    lower, upper = boxes.new_tensor(region).view(2, 2)
    start, stop = boxes[:, :2].clamp_min(lower), boxes[:, 2:].clamp_max(upper)
    width, height = (stop - start).clamp_min(0).unbind(1)
    counts = width * height
    member = torch.arange(len(boxes), device=boxes.device).repeat_interleave(counts)
    place = torch.arange(len(member), device=boxes.device) - (counts.cumsum(0) - counts)[member]
    row = start[member, 1] + place // width[member]
    return row * columns + start[member, 0] + place % width[member], member


def _similar(lengths: list[int], batch_pairs: int) -> Iterator[slice]:
    """Runs of a falling sequence of list lengths that are worth padding to the first of the run."""
    begin = 0
    for index, length in enumerate(lengths):
        longest = lengths[begin]
        if length < _LEAST_FILL * longest or (
            index > begin and (index - begin + 1) * longest > batch_pairs
        ):
            yield slice(begin, index)
            begin = index
    if lengths:
        yield slice(begin, len(lengths))


def _padded(
    members: Int[Tensor, " p"], first: Int[Tensor, " b"], lengths: Int[Tensor, " b"]
) -> Int[Tensor, "b l"]:
    """Rows of ``members`` from ``first`` on; short ones go on with the last entry, the padding."""
    column = torch.arange(int(lengths[0]), device=members.device)
    place = torch.where(column < lengths[:, None], first[:, None] + column, len(members) - 1)
    return members[place]

"""Kernel: front-to-back blending of the lists of some tiles.

Axes: ``c`` channels, planes are flat images whose rows are padded to whole tiles. Per pixel, with
the exponent of ``tables``:

    α = min(α_max, 2^e) where e reaches the cutoff and the light left has not fallen below its own
    image += α T channel,   T ← (1 - α) T

A tile's state lies in one buffer, plane by plane, block by block (8 × 2 pixels are one value of
sixteen lanes), so that it stays in the first-level cache and every access is one aligned line.
"""

import numpy as np

from diff4splat.kernels.jit import contracted, inlined
from diff4splat.kernels.simd16 import (
    LANES,
    any_of,
    count,
    exp2,
    fill,
    fma,
    less_product,
    minimum,
    select,
)
from diff4splat.kernels.simd_memory import (
    BLOCK_COLUMNS,
    BLOCK_ROWS,
    aligned_floats,
    block_columns,
    block_rows,
    load,
    prefetch,
    store,
    store_block,
)
from diff4splat.render.raster.blending.tiles import pixel_box
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.tables import (
    CENTER_X,
    CENTER_Y,
    LOG2_OPACITY,
    SHEAR,
    WHITEN_X,
    WHITEN_Y,
)

COLUMN_SHIFT, ROW_SHIFT = BLOCK_COLUMNS.bit_length() - 1, BLOCK_ROWS.bit_length() - 1
FIXED = 3
"""Channels that are always there; any further ones are looped over."""
_AHEAD = 8
UNSTOPPED = 3e38
"""Value in ``stops`` of a pixel whose complete list was blended."""


@kernel
def blend(tiles, grid, lists, prints, values, rules, planes, light, stops, median):
    """Blend ``tiles`` into ``planes`` (c · pixels), the light left, and where pixels stopped.

    ``median``, if not empty, gets the index of the Gaussian behind which at most half of the light
    is left, or -1.
    """
    size = plane_stride(grid)
    state = aligned_floats((3 + values.shape[1]) * size)
    for tile in tiles:
        first, last = lists.starts[tile], lists.starts[tile + 1]
        live = _begin(state, tile, grid, values.shape[1])
        for position in range(first, last):
            if live == 0:
                break
            ahead = lists.members[min(position + _AHEAD, last - 1)]
            prefetch(prints, ahead)
            prefetch(values, ahead)
            index = lists.members[position]
            live -= _add(state, tile, grid, prints, values, index, rules, position - first, median)
        _finish(state, tile, grid, planes, light, stops)
        if len(median):
            _finish_median(state, tile, grid, lists.members, first, median)


@contracted
def plane_stride(grid):
    """From plane to plane of a tile's state: not a multiple of 4 KiB.

    Addresses that agree in their last 12 bits look to a processor like the same one, and a load
    waits for a store to the other.
    """
    return grid.edge * grid.edge + 5 * LANES


@contracted
def _begin(state, tile, grid, channels):
    """Full light inside the image, none in the padding; returns the number of pixels."""
    size, live = plane_stride(grid), 0
    left, top = corner(tile, grid)
    for block in range(grid.edge * grid.edge // LANES):
        x, y = block_corner(block, grid)
        inside = (block_columns() + np.float32(left + x) < np.float32(grid.width)) & (
            block_rows() + np.float32(top + y) < np.float32(grid.height)
        )
        live += count(inside)
        place = block * LANES
        store(state, place, select(inside, fill(1.0), 0.0))
        store(state, size + place, fill(UNSTOPPED))
        store(state, 2 * size + place, fill(-1.0))
        for channel in range(channels):
            store(state, (3 + channel) * size + place, fill(0.0))
    return live


@contracted
def _add(state, tile, grid, prints, values, i, rules, rank, median):
    """Blend one Gaussian into the blocks its box touches; returns how many pixels went dark."""
    left, top = corner(tile, grid)
    x0, y0, x1, y1 = blocks_in_tile(prints, i, left, top, grid)
    red, green, blue = fill(values[i, 0]), fill(values[i, 1]), fill(values[i, 2])
    size, stopped = plane_stride(grid), 0
    step = fill(2 * prints[i, WHITEN_Y])
    for column in range(x0, x1 + 1):
        exponent_at_v0, _, v = start_column(prints, i, left, top, column, y0)
        for block_row in range(y0, y1 + 1):
            place = (column * (grid.edge >> ROW_SHIFT) + block_row) * LANES
            light = load(state, place)
            lit = light >= rules.light_cutoff
            if any_of(lit):
                exponent = less_product(exponent_at_v0, v, v)
                on = (exponent >= rules.log2_cutoff) & lit
                alpha = select(on, minimum(exp2(exponent), rules.alpha_max), 0.0)
                weight = alpha * light
                left_over = less_product(light, alpha, light)
                store(state, place, left_over)
                at = 3 * size + place
                store(state, at, fma(weight, red, load(state, at)))
                store(state, at + size, fma(weight, green, load(state, at + size)))
                store(state, at + 2 * size, fma(weight, blue, load(state, at + 2 * size)))
                for channel in range(FIXED, values.shape[1]):
                    at = (3 + channel) * size + place
                    store(state, at, fma(weight, values[i, channel], load(state, at)))
                dark = on & (left_over < rules.light_cutoff)
                if any_of(dark):
                    stopped += count(dark)
                    at = size + place
                    store(state, at, select(dark, fill(np.float32(rank + 1)), load(state, at)))
                if len(median):
                    _note_median(state, 2 * size + place, light, left_over, rank)
            v = v + step
    return stopped


@inlined
def start_column(prints, i, left, top, column, block_row):
    """log2 o - u² of a column of blocks, u, and v of its block in ``block_row``.

    Offsets are taken in float64: they may be a million pixels long.
    """
    dx = left + (column << COLUMN_SHIFT) + 0.5 - prints[i, CENTER_X]
    dy = top + (block_row << ROW_SHIFT) + 0.5 - prints[i, CENTER_Y]
    a, k, b = prints[i, WHITEN_X], prints[i, SHEAR], prints[i, WHITEN_Y]
    u = fma(block_columns(), a, fill(dx * a))
    v = less_product(fma(block_rows(), b, fill(dy * b - dx * k)), block_columns(), k)
    return less_product(prints[i, LOG2_OPACITY], u, u), u, v


@contracted
def _note_median(state, place, before, after, rank):
    half = (before > 0.5) & (after <= 0.5)
    store(state, place, select(half, fill(np.float32(rank)), load(state, place)))


@contracted
def _finish(state, tile, grid, planes, light, stops):
    """Write a tile to the image."""
    size, pitch = plane_stride(grid), grid.columns << grid.shift
    left, top = corner(tile, grid)
    for block in range(grid.edge * grid.edge // LANES):
        x, y = block_corner(block, grid)
        to, place = (top + y) * pitch + left + x, block * LANES
        store_block(light, to, pitch, load(state, place))
        store_block(stops, to, pitch, load(state, size + place))
        for channel in range(len(planes) // len(light)):
            value = load(state, (3 + channel) * size + place)
            store_block(planes, channel * len(light) + to, pitch, value)


@contracted
def _finish_median(state, tile, grid, members, first, median):
    """Positions in the list to indices of Gaussians."""
    size, pitch = plane_stride(grid), grid.columns << grid.shift
    left, top = corner(tile, grid)
    for pixel in range(grid.edge * grid.edge):
        x, y = block_corner(pixel // LANES, grid)
        lane = pixel % LANES
        to = (top + y + (lane >> COLUMN_SHIFT)) * pitch + left + x + lane % BLOCK_COLUMNS
        rank = np.int64(state[2 * size + pixel])
        median[to] = members[first + rank] if rank >= 0 else -1


@contracted
def corner(tile, grid):
    """(left, top) pixel of a tile."""
    return (tile % grid.columns) << grid.shift, (tile // grid.columns) << grid.shift


@contracted
def block_corner(block, grid):
    """(x, y) of a block inside its tile; blocks run down the columns."""
    rows = grid.edge >> ROW_SHIFT
    return (block // rows) << COLUMN_SHIFT, (block % rows) << ROW_SHIFT


@contracted
def blocks_in_tile(prints, i, left, top, grid):
    """First and last column, first and last row of blocks that the box of a footprint touches."""
    box_left, box_top, box_right, box_bottom = pixel_box(prints, i, grid.width, grid.height)
    return (
        max(box_left - left, 0) >> COLUMN_SHIFT,
        max(box_top - top, 0) >> ROW_SHIFT,
        min(box_right - left, grid.edge - 1) >> COLUMN_SHIFT,
        min(box_bottom - top, grid.edge - 1) >> ROW_SHIFT,
    )

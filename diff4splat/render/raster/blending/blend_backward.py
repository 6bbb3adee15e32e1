"""Kernels: gradients of blending, back to front, and their sums per Gaussian.

With g the gradient of a pixel, B = Σ over what lies behind of w (channel · g), plus the light left
times its gradient:

    ∂/∂α = T (channel · g) - B / (1 - α),   ∂/∂channel = w g

T is recovered by dividing by (1 - α), never below 1 - α_max. Every pair (tile, Gaussian) has its
own slot, and slots of one Gaussian are neighbours, so the sums are taken in one order whatever the
threads do. The exponent is e = log2 o - u² - v², and lanes collect ∂/∂ln α times 1, v and v² down a
column of blocks before they are weighted with u, which is the same for all of them.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.kernels.jit import contracted
from diff4splat.kernels.simd16 import (
    LANES,
    any_of,
    exp2,
    fill,
    fma,
    less_product,
    minimum,
    select,
    total,
    totals,
)
from diff4splat.kernels.simd_memory import (
    aligned_floats,
    load,
    load_block,
    prefetch,
    store,
    store_eight,
)
from diff4splat.render.raster.blending.blend import (
    FIXED,
    ROW_SHIFT,
    block_corner,
    blocks_in_tile,
    corner,
    plane_stride,
    start_column,
)
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.tables import MOMENTS, WHITEN_Y, Doubles, Floats, Grid

_AHEAD = 8
_LIGHT, _STOP, _BEHIND, _GRADIENT = range(4)
"""Planes of a tile's state; one gradient plane per channel from the last on."""


class _Tile(NamedTuple):
    """A tile, and what is kept of it while its list is worked through."""

    grid: Grid
    left: int
    top: int
    state: Floats
    sums: Floats
    """Gradients of the channels after the first three, by lane."""


class _Pair(NamedTuple):
    """A Gaussian in the list of a tile."""

    index: int
    rank: int
    slot: int


class _Splats(NamedTuple):
    """All Gaussians: footprints and channels."""

    prints: Doubles
    values: Floats


@kernel
def blend_backward(tiles, grid, lists, prints, values, rules, light, stops, grads, slots):
    """Fill the slot (6 moments of ∂/∂ln α, then channels) of every pair of ``tiles``.

    ``grads`` holds the gradients of the planes, then that of the light ((c + 1) · pixels).
    """
    size, channels = plane_stride(grid), values.shape[1]
    state = aligned_floats((_GRADIENT + channels) * size)
    sums, splats = aligned_floats(channels * LANES), _Splats(prints, values)
    for tile in tiles:
        first, last = lists.starts[tile], lists.starts[tile + 1]
        if first == last:
            continue
        seen = _begin(state, tile, grid, light, stops, grads)
        left, top = corner(tile, grid)
        area = _Tile(grid, left, top, state, sums)
        for position in range(last - 1, first - 1, -1):
            ahead = lists.members[max(position - _AHEAD, first)]
            prefetch(prints, ahead)
            prefetch(values, ahead)
            slot, rank = lists.slots[position], position - first
            if rank < seen:
                pair = _Pair(lists.members[position], rank, slot)
                _subtract(area, pair, splats, rules, slots)
            else:
                for column in range(slots.shape[1]):
                    slots[slot, column] = 0


@contracted
def _begin(state, tile, grid, light, stops, grads):
    """Load the end state of a tile; returns how many entries of its list any pixel looked at."""
    size, pitch = plane_stride(grid), grid.columns << grid.shift
    left, top = corner(tile, grid)
    channels = len(grads) // len(light) - 1
    for block in range(grid.edge * grid.edge // LANES):
        x, y = block_corner(block, grid)
        at, place = (top + y) * pitch + left + x, block * LANES
        remaining = load_block(light, at, pitch)
        store(state, _LIGHT * size + place, remaining)
        store(state, _STOP * size + place, load_block(stops, at, pitch))
        store(
            state,
            _BEHIND * size + place,
            remaining * load_block(grads, channels * len(light) + at, pitch),
        )
        for channel in range(channels):
            gradient = load_block(grads, channel * len(light) + at, pitch)
            store(state, (_GRADIENT + channel) * size + place, gradient)
    seen = 0.0
    for pixel in range(grid.edge * grid.edge):
        # The padding has no light, and must not keep a tile going.
        if state[_LIGHT * size + pixel] > 0:
            seen = max(seen, np.float64(state[_STOP * size + pixel]))
    return seen


@contracted
def _subtract(tile, pair, splats, rules, slots):
    """Take one Gaussian out of the blocks its box touches, and write its gradient."""
    grid, state, i, prints = tile.grid, tile.state, pair.index, splats.prints
    x0, y0, x1, y1 = blocks_in_tile(prints, i, tile.left, tile.top, grid)
    color = _first_channels(splats.values, i)
    size = plane_stride(grid)
    step, none = fill(2 * prints[i, WHITEN_Y]), fill(0.0)
    e, eu, euu, ev, euv, evv = none, none, none, none, none, none
    to_red, to_green, to_blue = none, none, none
    _clear_sums(tile.sums, splats.values)
    for column in range(x0, x1 + 1):
        exponent_at_v0, u, v = start_column(prints, i, tile.left, tile.top, column, y0)
        moment0, moment1, moment2 = none, none, none
        for block_row in range(y0, y1 + 1):
            place = (column * (grid.edge >> ROW_SHIFT) + block_row) * LANES
            looked = load(state, _STOP * size + place) > np.float32(pair.rank)
            if any_of(looked):
                exponent = less_product(exponent_at_v0, v, v)
                alpha, free = _opacity(exponent, looked, rules)
                inverse = fill(1.0) / (fill(1.0) - alpha)
                light = load(state, _LIGHT * size + place) * inverse
                behind = load(state, _BEHIND * size + place)
                weight = alpha * light
                red, green, blue = _first_gradients(state, place, size)
                worth = fma(color[0], red, fma(color[1], green, color[2] * blue))
                worth = _other_channels(tile, place, splats.values, i, weight, worth)
                to_red = fma(weight, red, to_red)
                to_green = fma(weight, green, to_green)
                to_blue = fma(weight, blue, to_blue)
                to_alpha = less_product(light * worth, behind, inverse)
                store(state, _LIGHT * size + place, light)
                store(state, _BEHIND * size + place, fma(weight, worth, behind))
                to_log = select(free, to_alpha * alpha, 0.0)
                moment0 = moment0 + to_log
                moment1 = fma(to_log, v, moment1)
                moment2 = fma(to_log * v, v, moment2)
            v = v + step
        e, ev, evv = e + moment0, ev + moment1, evv + moment2
        eu, euu, euv = fma(moment0, u, eu), fma(moment0 * u, u, euu), fma(moment1, u, euv)
    store_eight(
        slots, pair.slot * slots.shape[1], totals(e, eu, euu, ev, euv, evv, to_red, to_green)
    )
    slots[pair.slot, MOMENTS + 2] = total(to_blue)
    _write_sums(tile.sums, splats.values, slots, pair.slot)


@contracted
def _first_channels(values, i):
    return fill(values[i, 0]), fill(values[i, 1]), fill(values[i, 2])


@contracted
def _first_gradients(state, place, size):
    at = _GRADIENT * size + place
    return load(state, at), load(state, at + size), load(state, at + 2 * size)


@contracted
def _opacity(exponent, looked, rules):
    """Opacity per lane, 0 below the cutoff; and where it is below its bound, and so has a slope."""
    on = (exponent >= rules.log2_cutoff) & looked
    response = exp2(exponent)
    free = on & (response <= rules.alpha_max)
    return select(on, minimum(response, rules.alpha_max), 0.0), free


@contracted
def _clear_sums(sums, values):
    for channel in range(FIXED, values.shape[1]):
        store(sums, channel * LANES, fill(0.0))


@contracted
def _other_channels(tile, place, values, i, weight, worth):
    """Add the channels after the first three to ``worth``, and their gradients to the sums."""
    size = plane_stride(tile.grid)
    for channel in range(FIXED, values.shape[1]):
        gradient = load(tile.state, (_GRADIENT + channel) * size + place)
        worth = fma(gradient, values[i, channel], worth)
        at = channel * LANES
        store(tile.sums, at, fma(weight, gradient, load(tile.sums, at)))
    return worth


@contracted
def _write_sums(sums, values, slots, slot):
    for channel in range(FIXED, values.shape[1]):
        slots[slot, MOMENTS + channel] = total(load(sums, channel * LANES))


@kernel
def sum_slots(first, last, order, first_slots, slots, moments, value_grads):
    """Add the slots of every Gaussian of ranks ``first`` to ``last``, in the order of its tiles."""
    for rank in range(first, last):
        # Sums go to rows in any order; the next ones are fetched meanwhile.
        ahead = order[min(rank + _AHEAD, last - 1)]
        prefetch(moments, ahead)
        prefetch(value_grads, ahead)
        index, start, stop = order[rank], first_slots[rank], first_slots[rank + 1]
        for column in range(MOMENTS):
            moments[index, column] += _column_sum(slots, column, start, stop)
        for channel in range(value_grads.shape[1]):
            value_grads[index, channel] += _column_sum(slots, MOMENTS + channel, start, stop)


@contracted
def _column_sum(slots, column, start, stop):
    total_so_far = 0.0
    for slot in range(start, stop):
        total_so_far += slots[slot, column]
    return np.float32(total_so_far)

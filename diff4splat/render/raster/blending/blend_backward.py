"""Kernels: gradients of blending, back to front, and their sums per Gaussian.

With g the gradient of a pixel, B = Σ over what lies behind of w (channel · g), plus the light left
times its gradient:

    ∂/∂α = T (channel · g) - B / (1 - α),   ∂/∂channel = w g

T is recovered by dividing by (1 - α), never below 1 - α_max. Every pair (tile, Gaussian) has its
own slot, and slots of one Gaussian are neighbours, so the sums are taken in one order whatever the
threads do. The exponent is e = log2 o - u² - v², and lanes collect ∂/∂ln α times 1, v and v² down a
column of blocks before they are weighted with u, which is the same for all of them.
"""

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
from diff4splat.render.raster.tables import MOMENTS, WHITEN_Y

_AHEAD = 8
_LIGHT, _STOP, _BEHIND, _GRADIENT = range(4)
"""Planes of a tile's state; one gradient plane per channel from the last on."""


@kernel
def blend_backward(tiles, grid, lists, prints, values, rules, light, stops, grads, slots):
    """Fill the slot (6 moments of ∂/∂ln α, then channels) of every pair of ``tiles``.

    ``grads`` holds the gradients of the planes, then that of the light ((c + 1) · pixels).
    """
    size, channels = plane_stride(grid), values.shape[1]
    state = aligned_floats((_GRADIENT + channels) * size)
    sums = aligned_floats(channels * LANES)
    for tile in tiles:
        first, last = lists.starts[tile], lists.starts[tile + 1]
        if first == last:
            continue
        seen = _begin(state, tile, grid, light, stops, grads)
        for position in range(last - 1, first - 1, -1):
            ahead = lists.members[max(position - _AHEAD, first)]
            prefetch(prints, ahead)
            prefetch(values, ahead)
            index, slot, rank = lists.members[position], lists.slots[position], position - first
            if rank < seen:
                _subtract(state, sums, tile, grid, prints, values, index, rules, rank, slots, slot)
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
def _subtract(state, sums, tile, grid, prints, values, i, rules, rank, slots, slot):
    """Take one Gaussian out of the blocks its box touches, and write its gradient."""
    left, top = corner(tile, grid)
    x0, y0, x1, y1 = blocks_in_tile(prints, i, left, top, grid)
    red, green, blue = fill(values[i, 0]), fill(values[i, 1]), fill(values[i, 2])
    size = plane_stride(grid)
    step = fill(2 * prints[i, WHITEN_Y])
    none = fill(0.0)
    e, eu, euu, ev, euv, evv = none, none, none, none, none, none
    to_red, to_green, to_blue = none, none, none
    for channel in range(FIXED, values.shape[1]):
        store(sums, channel * LANES, none)
    for column in range(x0, x1 + 1):
        exponent_at_v0, u, v = start_column(prints, i, left, top, column, y0)
        moment0, moment1, moment2 = none, none, none
        for block_row in range(y0, y1 + 1):
            place = (column * (grid.edge >> ROW_SHIFT) + block_row) * LANES
            looked = load(state, _STOP * size + place) > np.float32(rank)
            if any_of(looked):
                exponent = less_product(exponent_at_v0, v, v)
                on = (exponent >= rules.log2_cutoff) & looked
                response = exp2(exponent)
                free = on & (response <= rules.alpha_max)
                alpha = select(on, minimum(response, rules.alpha_max), 0.0)
                inverse = fill(1.0) / (fill(1.0) - alpha)
                light = load(state, _LIGHT * size + place) * inverse
                behind = load(state, _BEHIND * size + place)
                weight = alpha * light
                at = _GRADIENT * size + place
                g_red, g_green = load(state, at), load(state, at + size)
                g_blue = load(state, at + 2 * size)
                worth = fma(red, g_red, fma(green, g_green, blue * g_blue))
                for channel in range(FIXED, values.shape[1]):
                    gradient = load(state, (_GRADIENT + channel) * size + place)
                    worth = fma(gradient, values[i, channel], worth)
                    at = channel * LANES
                    store(sums, at, fma(weight, gradient, load(sums, at)))
                to_red = fma(weight, g_red, to_red)
                to_green = fma(weight, g_green, to_green)
                to_blue = fma(weight, g_blue, to_blue)
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
    moments = totals(e, eu, euu, ev, euv, evv, to_red, to_green)
    store_eight(slots, slot * slots.shape[1], moments)
    slots[slot, MOMENTS + 2] = total(to_blue)
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

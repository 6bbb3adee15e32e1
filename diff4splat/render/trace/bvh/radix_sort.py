"""Kernels: stable radix sort of wide keys, and places along a curve that fills space.

Neighbours on Hilbert's curve are neighbours in space, so runs of it are compact (Skilling,
"Programming the Hilbert curve", 2004).
"""

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.tables import Integers

_DIGIT_BITS = np.uint64(11)
_BUCKETS = 1 << 11
_DIGIT_MASK = np.uint64(_BUCKETS - 1)


def sorted_order(keys: np.ndarray) -> Integers:
    """Indices of uint64 ``keys`` from small to large, equal ones by index."""
    order = np.arange(len(keys), dtype=np.int32)
    if len(keys):
        order = sort_keys(keys.copy(), order, np.empty_like(keys), np.empty_like(order))
    return order


@kernel
def sort_keys(keys, order, spare_keys, spare_order):
    """``order`` by ``keys``; everything is scratch afterwards. Digits that agree are skipped."""
    used = np.uint64(0)
    for key in keys:
        used |= key ^ keys[0]
    shift = np.uint64(0)
    while used > 0:
        if used & _DIGIT_MASK:
            _scatter(keys, order, spare_keys, spare_order, shift)
            keys, spare_keys = spare_keys, keys
            order, spare_order = spare_order, order
        shift += _DIGIT_BITS
        used >>= _DIGIT_BITS
    return order


@inlined
def _scatter(keys, order, to_keys, to_order, shift):
    """One pass: stable counting sort by one digit."""
    starts = np.zeros(_BUCKETS, np.int64)
    for key in keys:
        starts[(key >> shift) & _DIGIT_MASK] += 1
    running = 0
    for bucket in range(_BUCKETS):
        size = starts[bucket]
        starts[bucket] = running
        running += size
    for place in range(len(keys)):
        bucket = (keys[place] >> shift) & _DIGIT_MASK
        to_keys[starts[bucket]] = keys[place]
        to_order[starts[bucket]] = order[place]
        starts[bucket] += 1


@inlined
def hilbert(corner, dimensions, depth):
    """Place of a cell along the curve; ``corner`` (whole numbers below 2^depth) is overwritten."""
    bit = 1 << (depth - 1)
    while bit > 1:
        below = bit - 1
        for axis in range(dimensions):
            if corner[axis] & bit:
                corner[0] ^= below
            else:
                swap = (corner[0] ^ corner[axis]) & below
                corner[0] ^= swap
                corner[axis] ^= swap
        bit >>= 1
    for axis in range(1, dimensions):
        corner[axis] ^= corner[axis - 1]
    turn, bit = 0, 1 << (depth - 1)
    while bit > 1:
        if corner[dimensions - 1] & bit:
            turn ^= bit - 1
        bit >>= 1
    place = 0
    for level in range(depth - 1, -1, -1):
        for axis in range(dimensions):
            place = (place << 1) | (((corner[axis] ^ turn) >> level) & 1)
    return place

"""Kernel: nearest first, by radix sort of the bits of the depth; equal depths keep their order.

Positive float32 numbers sort like their bits. A key is these bits above the index of the Gaussian,
so one array moves; digits in which all keys agree are skipped.
"""

import numpy as np

from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.tables import Integers

_DIGIT_BITS = 11
_BUCKETS = 1 << _DIGIT_BITS
_INDEX_BITS = np.uint64(32)
_INDEX_MASK = np.uint64((1 << 32) - 1)
_DIGIT_MASK = np.uint64(_BUCKETS - 1)


def depth_sort(visible: Integers, depth: np.ndarray) -> Integers:
    """``visible`` indices in order of their float32 ``depth``, which must be positive."""
    keys = np.empty(len(visible), np.uint64)
    order = np.empty(len(visible), np.int32)
    if len(visible):
        sort_by_depth(visible, depth.view(np.uint32), keys, np.empty_like(keys), order)
    return order


@kernel
def sort_by_depth(visible, depth_bits, keys, spare, order):
    """Write ``visible`` to ``order``, stably sorted; ``keys`` and ``spare`` are scratch."""
    low = high = depth_bits[visible[0]]
    for rank in range(len(visible)):
        bits = depth_bits[visible[rank]]
        low, high = min(low, bits), max(high, bits)
        keys[rank] = (np.uint64(bits) << _INDEX_BITS) | np.uint64(visible[rank])
    base, span = np.uint64(low) << _INDEX_BITS, np.uint64(high - low)
    shift = _INDEX_BITS
    while span > 0:
        _scatter(keys, spare, base, shift)
        keys, spare = spare, keys
        shift += np.uint64(_DIGIT_BITS)
        span >>= np.uint64(_DIGIT_BITS)
    for rank in range(len(keys)):
        order[rank] = np.int32(keys[rank] & _INDEX_MASK)


@contracted
def _scatter(keys, spare, base, shift):
    """One pass: stable counting sort by one digit."""
    starts = np.zeros(_BUCKETS, np.int64)
    for key in keys:
        starts[((key - base) >> shift) & _DIGIT_MASK] += 1
    running = 0
    for bucket in range(_BUCKETS):
        size = starts[bucket]
        starts[bucket] = running
        running += size
    for key in keys:
        bucket = ((key - base) >> shift) & _DIGIT_MASK
        spare[starts[bucket]] = key
        starts[bucket] += 1

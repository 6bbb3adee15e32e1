"""Candidate primitives of a packet of rays: down the tree, sixteen children at once.

A node or primitive is skipped when it lies outside one of the planes around the rays. Candidates
are sorted by the z of the mean, or by a little more than the least z at which the packet can
intersect them if that is less. So hits arrive nearly in order, and each candidate bounds the depth
of those that follow.
"""

import numpy as np

from diff4splat.kernels.addresses import bits, first_bit, last_bit, root
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, fill, fma, minimum, select
from diff4splat.kernels.simd_memory import load, store
from diff4splat.render.trace.tables import (
    LEAF_AXES,
    LEAF_MEAN,
    LEAF_SLACK,
    LEAF_VELOCITY,
    NODE_ROWS,
    STATIC_ROWS,
)
from diff4splat.render.trace.traversal.frame import PLANES, ROUNDING
from diff4splat.render.trace.traversal.scratch import BUCKETS

_INDEX_BITS = np.uint64(32)
_INDEX_MASK = np.uint64((1 << 32) - 1)
_DIGIT_BITS, _DIGIT_MASK = np.uint64(8), np.uint64(BUCKETS - 1)
_DROPPED_BITS = np.uint64(12)
"""Depths are sorted to one part in two thousand: lists need only be nearly in order."""
EXTENT_SLACK = np.float32(1.00002)
"""Relative margin of extents: rounding here must not drop what a ray intersects."""

ORDER_SLACK = np.float32(1.03)
"""Sort key of a candidate at most, relative to its least z."""


@inlined
def find_candidates(scene, frame, scratch):
    """List candidates in ``scratch.members`` by ``scratch.depths``; returns their number.

    Returns -1 if they do not fit.
    """
    tree, planes, rows = scene.tree, scratch.planes, scratch.rows
    nodes, leaves = tree.nodes.reshape(-1), scene.leaves.reshape(-1)
    groups, height = (len(tree.order) + LANES - 1) // LANES, len(tree.levels) - 2
    stack, top, count = scratch.stack, 0, 0
    if groups:
        stack[0], top = height << 32, 1
    while top > 0:
        top -= 1
        level, node = stack[top] >> 32, stack[top] & 0xFFFFFFFF
        at = (tree.levels[level] + node) * NODE_ROWS * LANES
        inside = bits(_boxes_inside(nodes, at, planes, rows))
        while inside != 0 and level > 0:
            # The stack is last in, first out: candidates are listed in the order of the tree.
            last = last_bit(inside)
            inside ^= 1 << last
            stack[top] = ((level - 1) << 32) | (node * LANES + last)
            top += 1
        while inside != 0:
            group = node * LANES + first_bit(inside)
            inside &= inside - 1
            if count + LANES > len(scratch.keys):
                return -1
            count = _leaf(scene, leaves, group, frame, planes, scratch, count)
    _sort(scratch, count)
    return count


@inlined
def _boxes_inside(nodes, at, planes, rows):
    """Which of sixteen boxes have their innermost corner inside of every plane."""
    inside = _corner(nodes, at, planes, rows, 0) <= planes[3]
    for side in range(1, PLANES):
        inside = inside & (_corner(nodes, at, planes, rows, side) <= planes[4 * side + 3])
    return inside


@inlined
def _corner(nodes, at, planes, rows, side):
    x, y, z = rows[3 * side], rows[3 * side + 1], rows[3 * side + 2]
    return fma(
        load(nodes, at + x),
        planes[4 * side],
        fma(load(nodes, at + y), planes[4 * side + 1], load(nodes, at + z) * planes[4 * side + 2]),
    )


@inlined
def _leaf(scene, leaves, group, frame, planes, scratch, count):
    """Add the primitives of a group that reach into the beam."""
    at, front = group * scene.leaves.shape[1] * LANES, PLANES - 1
    slack = load(leaves, at + LEAF_SLACK * LANES)
    behind, ahead = _distances(scene, leaves, at, frame, planes, front)
    extent = root(_squared_extent(leaves, at, planes, front)) * EXTENT_SLACK + slack
    alive = behind <= extent
    for side in range(front):
        distance, _ = _distances(scene, leaves, at, frame, planes, side)
        beyond = distance - slack
        beyond = select(beyond > 0.0, beyond, 0.0)
        limit = _squared_extent(leaves, at, planes, side) * EXTENT_SLACK
        alive = alive & (beyond * beyond <= limit)
    # What is in front has a negative distance from the plane there.
    middle = fill(-2 * planes[ROUNDING]) - ahead
    depth = minimum(middle, (middle - extent) * ORDER_SLACK)
    # All rays begin in front; bits sort like numbers that are not negative.
    store(scratch.lane_depths, 0, select(depth > 0.0, depth, 0.0))
    left = bits(alive)
    while left != 0:
        lane = first_bit(left)
        left &= left - 1
        scratch.unsorted[count] = scene.tree.order[group * LANES + lane]
        depth = np.uint64(scratch.lane_depth_bits[lane]) >> _DROPPED_BITS
        scratch.keys[count] = (depth << _INDEX_BITS) | np.uint64(count)
        count += 1
    return count


@inlined
def _distances(scene, leaves, at, frame, planes, side):
    """The least and the largest distance of means outside a plane, over the times of the packet."""
    distance = _along(leaves, at + LEAF_MEAN * LANES, planes, side) - planes[4 * side + 3]
    if scene.leaves.shape[1] == STATIC_ROWS:
        return distance, distance
    drift = _along(leaves, at + LEAF_VELOCITY * LANES, planes, side)
    since = frame.time - scene.moment
    early = fma(drift, np.float32(since + frame.early), distance)
    late = fma(drift, np.float32(since + frame.late), distance)
    return minimum(early, late), early + late - minimum(early, late)


@inlined
def _along(leaves, at, planes, side):
    """Components of three rows along a normal."""
    return fma(
        load(leaves, at),
        planes[4 * side],
        fma(
            load(leaves, at + LANES),
            planes[4 * side + 1],
            load(leaves, at + 2 * LANES) * planes[4 * side + 2],
        ),
    )


@inlined
def _squared_extent(leaves, at, planes, side):
    """|reach · S Rᵀ n|²."""
    axes = at + LEAF_AXES * LANES
    x = _along(leaves, axes, planes, side)
    y = _along(leaves, axes + 3 * LANES, planes, side)
    z = _along(leaves, axes + 6 * LANES, planes, side)
    return fma(x, x, fma(y, y, z * z))


@inlined
def _sort(scratch, count):
    """Candidates by the leading bits of their depth, equal ones in the order of the tree."""
    keys, spare, starts = scratch.keys, scratch.spare_keys, scratch.starts
    low, high = ~np.uint64(0), np.uint64(0)
    for place in range(count):
        key = keys[place] >> _INDEX_BITS
        low, high = min(low, key), max(high, key)
    span, shift = high - low if count else np.uint64(0), _INDEX_BITS
    while span > 0:
        _scatter(keys, spare, starts, count, low << _INDEX_BITS, shift)
        keys, spare = spare, keys
        shift += _DIGIT_BITS
        span >>= _DIGIT_BITS
    for rank in range(count):
        key = keys[rank]
        scratch.depth_bits[rank] = np.uint32((key >> _INDEX_BITS) << _DROPPED_BITS)
        scratch.members[rank] = scratch.unsorted[np.int64(key & _INDEX_MASK)]


@inlined
def _scatter(keys, spare, starts, count, base, shift):
    """One pass: stable counting sort by one digit."""
    starts[:] = 0
    for place in range(count):
        starts[((keys[place] - base) >> shift) & _DIGIT_MASK] += 1
    running = 0
    for bucket in range(len(starts)):
        size = starts[bucket]
        starts[bucket] = running
        running += size
    for place in range(count):
        bucket = ((keys[place] - base) >> shift) & _DIGIT_MASK
        spare[starts[bucket]] = keys[place]
        starts[bucket] += 1

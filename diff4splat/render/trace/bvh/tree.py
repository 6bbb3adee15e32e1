"""A search tree over boxes: sixteen neighbours along Hilbert's curve to a group, sixteen to a node.

Axes: ``n`` boxes, ``m`` of them that hold something. There are no pointers: child c of node i is
node 16 i + c one level below. Boxes of similar size are neighbours first, so that a large one does
not widen the nodes of small ones. Sixteen children are tested at once.
"""

import math

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.kernels.simd16 import LANES
from diff4splat.render.raster.padded_image import empty
from diff4splat.render.trace.bvh.boxes import PRIMITIVES_PER_PART, Boxes
from diff4splat.render.trace.bvh.radix_sort import hilbert, sorted_order
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.tables import NODE_ROWS, Integers, Tree

NO_ORDER = np.empty(0, np.int32)
_DEPTH = 12
"""Bits of a place along each axis."""
_SIZE_CLASSES, _OCTAVES = 16, 3
SLACK = 1e-6
"""Relative margin of float32 corners, larger than the rounding of the tests."""


def build_tree(boxes: Boxes, given: Integers = NO_ORDER) -> Tree:
    """The tree of the boxes that hold something; equal boxes give equal bits on any threads.

    ``given`` is an order to keep, as of boxes that have moved since: boxes that are empty now are
    removed from it, boxes that it does not list follow. Traversal slows down as neighbours part.
    """
    anchor, extent = _surroundings(boxes)
    fresh = boxes.lower[:, 0] <= boxes.upper[:, 0]
    given = given[fresh[given]]
    fresh[given] = False
    order = _neighbours(np.flatnonzero(fresh).astype(np.int32), boxes, anchor, extent)
    tree = _shaped(np.concatenate([given, order]), anchor)
    groups = -(-len(tree.order) // LANES)

    def work(first: int, last: int) -> None:
        fit_groups(first, last, tree, boxes)

    # A part covers complete nodes, so that no two parts write to one node.
    parallel_for(work, ranges(groups, PRIMITIVES_PER_PART))
    fit_nodes(tree.nodes, tree.levels, groups)
    return tree


def _neighbours(
    listed: Integers, boxes: Boxes, anchor: tuple[float, float, float], extent: float
) -> Integers:
    """The ``listed`` boxes, neighbours next to each other."""
    keys = np.empty(len(listed), np.uint64)

    def work(first: int, last: int) -> None:
        place_keys(first, last, listed, boxes, anchor, extent, keys)

    parallel_for(work, ranges(len(listed), PRIMITIVES_PER_PART))
    return listed[sorted_order(keys)]


def _surroundings(boxes: Boxes) -> tuple[tuple[float, float, float], float]:
    """Middle and largest half size of what all boxes hold."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    surround(boxes.lower, boxes.upper, low, high)
    if not (low <= high).all():
        return (0.0, 0.0, 0.0), 1.0
    middle = 0.5 * (low + high)
    return tuple(middle.tolist()), max(float((high - middle).max()), 1e-300)


def _shaped(order: Integers, anchor: tuple[float, float, float]) -> Tree:
    """A tree with room for all nodes."""
    levels, count = [0], -(-len(order) // LANES)
    while count:
        count = -(-count // LANES)
        levels.append(levels[-1] + count)
        if count == 1:
            break
    return Tree(
        order=order,
        nodes=empty(levels[-1], NODE_ROWS, LANES),
        levels=np.array(levels, np.int64),
        anchor=anchor,
    )


@kernel
def surround(lower, upper, low, high):
    """The box around all boxes into ``low`` and ``high``; NumPy takes long over three columns."""
    for i in range(len(lower)):
        for axis in range(3):
            low[axis] = min(low[axis], lower[i, axis])
            high[axis] = max(high[axis], upper[i, axis])


@kernel
def place_keys(first, last, listed, boxes, anchor, extent, keys):
    """Size class, then place along the curve, of the boxes in ``listed[first:last]``."""
    cell, lower, upper = np.empty(3, np.int64), boxes.lower, boxes.upper
    side = 1 << _DEPTH
    for place in range(first, last):
        i, half = listed[place], 0.0
        for axis in range(3):
            half = max(half, 0.5 * (upper[i, axis] - lower[i, axis]))
            middle = 0.5 * (lower[i, axis] + upper[i, axis]) - anchor[axis]
            cell[axis] = min(max(int((0.5 + 0.5 * middle / extent) * side), 0), side - 1)
        octave = math.log2(extent / half) / _OCTAVES if half > 0 else _SIZE_CLASSES
        size_class = min(max(int(octave), 0), _SIZE_CLASSES - 1)
        keys[place] = np.uint64(size_class << (3 * _DEPTH)) | np.uint64(hilbert(cell, 3, _DEPTH))


@kernel
def fit_groups(first, last, tree, boxes):
    """Boxes of the groups ``first`` to ``last`` into the lowest nodes; nothing behind the last."""
    order, nodes, lower, upper = tree.order, tree.nodes, boxes.lower, boxes.upper
    groups = (len(order) + LANES - 1) // LANES
    stop = last if last < groups else (groups + LANES - 1) // LANES * LANES
    for group in range(first, stop):
        start, end = group * LANES, min((group + 1) * LANES, len(order))
        for axis in range(3):
            low, high = np.inf, -np.inf
            for place in range(start, end):
                low = min(low, lower[order[place], axis])
                high = max(high, upper[order[place], axis])
            node, child = group // LANES, group % LANES
            nodes[node, axis, child] = _outward(low - tree.anchor[axis], -1.0)
            nodes[node, axis + 3, child] = _outward(high - tree.anchor[axis], 1.0)


@inlined
def _outward(corner, sign):
    # Infinite corners of empty boxes stay: infinity minus infinity is NaN.
    return np.float32(corner + sign * SLACK * abs(corner) if abs(corner) < np.inf else corner)


@kernel
def fit_nodes(nodes, levels, groups):
    """Boxes of all higher levels from those below."""
    for level in range(1, len(levels) - 1):
        below = levels[level] - levels[level - 1]
        for node in range(levels[level], levels[level + 1]):
            for child in range(LANES):
                source = (node - levels[level]) * LANES + child
                for row in range(3):
                    low, high = np.float32(np.inf), np.float32(-np.inf)
                    if source < below:
                        for lane in range(LANES):
                            low = min(low, nodes[levels[level - 1] + source, row, lane])
                            high = max(high, nodes[levels[level - 1] + source, row + 3, lane])
                    nodes[node, row, child], nodes[node, row + 3, child] = low, high

"""Kernel: bounds of primitives in groups of sixteen, for the test against a packet.

Groups are as in the tree. A primitive lies behind a plane with normal n where n · (mean - origin)
exceeds |reach · S Rᵀ n|: the exact extent of the ellipsoid along n.
"""

import numpy as np

from diff4splat.kernels.addresses import address, prefetch_at
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.kernels.simd16 import LANES
from diff4splat.render.raster.padded_image import empty
from diff4splat.render.trace.bvh.tree import SLACK
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.tables import (
    CENTER,
    LEAF_AXES,
    LEAF_MEAN,
    LEAF_SLACK,
    LEAF_VELOCITY,
    MEAN,
    MOVING_ROWS,
    SCALES,
    STATIC_ROWS,
    VELOCITY,
    WHITEN,
    Doubles,
    Floats,
    Tree,
)

_GROUPS_PER_PART = 256
_AHEAD, _PREFETCHED = 12, 128
"""How many primitives ahead they are fetched, and bytes at once; they lie in any order."""


def gather_leaves(tree: Tree, primitives: Doubles, reach: Doubles, moment: float) -> Floats:
    """The primitives of ``tree``, group by group, with means at the time ``moment``."""
    groups = -(-len(tree.order) // LANES)
    rows = MOVING_ROWS if primitives.shape[1] > VELOCITY else STATIC_ROWS
    leaves = empty(groups, rows, LANES)

    def work(first: int, last: int) -> None:
        fill_leaves(first, last, tree, primitives, reach, moment, leaves)

    parallel_for(work, ranges(groups, _GROUPS_PER_PART))
    return leaves


@kernel
def fill_leaves(first, last, tree, primitives, reach, moment, leaves):
    """Fill groups ``first`` to ``last``; slots after the last primitive intersect no ray."""
    table, row_bytes, count = address(primitives), 8 * primitives.shape[1], len(tree.order)
    for group in range(first, last):
        for lane in range(LANES):
            ahead = tree.order[min(group * LANES + lane + _AHEAD, count - 1)]
            prefetch_at(table + row_bytes * np.int64(ahead))
            prefetch_at(table + row_bytes * np.int64(ahead) + _PREFETCHED)
            if group * LANES + lane < count:
                _fill(leaves, group, lane, tree, primitives, reach, moment)
            else:
                leaves[group, :, lane] = np.nan


@inlined
def _fill(leaves, group, lane, tree, primitives, reach, moment):
    i = tree.order[group * LANES + lane]
    size, largest = 0.0, 0.0
    for axis in range(3):
        mean = primitives[i, MEAN + axis] - tree.anchor[axis]
        if primitives.shape[1] > VELOCITY:
            velocity = primitives[i, VELOCITY + axis]
            mean += velocity * (moment - primitives[i, CENTER])
            leaves[group, LEAF_VELOCITY + axis, lane] = velocity
        leaves[group, LEAF_MEAN + axis, lane] = mean
        size += abs(mean)
        scale = primitives[i, SCALES + axis]
        largest = max(largest, scale)
        for column in range(3):
            turned = primitives[i, WHITEN + 3 * axis + column] * scale
            leaves[group, LEAF_AXES + 3 * axis + column, lane] = reach[i] * scale * turned
    leaves[group, LEAF_SLACK, lane] = SLACK * (size + reach[i] * largest)

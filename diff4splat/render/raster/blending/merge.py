"""Kernels: static and moving Gaussians, merged by depth.

Both sides are sorted, nearest first and equal depths by index, so merging them is what sorting all
would give.
"""

from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel


@kernel
def merge_orders(static, moving, depth, order):
    """Merge two orders into ``order``."""
    a = b = 0
    for rank in range(len(order)):
        if b == len(moving) or (a < len(static) and _before(static[a], moving[b], depth)):
            order[rank] = static[a]
            a += 1
        else:
            order[rank] = moving[b]
            b += 1


@kernel
def merge_lists(first, last, tiles, static, moving, depth, lists):
    """Merge the lists of ``tiles[first:last]`` into ``lists``, whose starts are known."""
    for place in range(first, last):
        tile = tiles[place]
        a, end_a = static.starts[tile], static.starts[tile + 1]
        b, end_b = moving.starts[tile], moving.starts[tile + 1]
        for position in range(lists.starts[tile], lists.starts[tile + 1]):
            take_static = b == end_b or (
                a < end_a and _before(static.members[a], moving.members[b], depth)
            )
            if take_static:
                lists.members[position] = static.members[a]
                a += 1
            else:
                lists.members[position] = moving.members[b]
                b += 1


@contracted
def _before(left, right, depth):
    return depth[left] < depth[right] or (depth[left] == depth[right] and left < right)

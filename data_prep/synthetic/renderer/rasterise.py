"""Kernel: which triangle is nearest along each direction of a lattice.

With vertices a, b, c in camera axes and a direction d = (x, y, 1), in homogeneous form (Olano and
Greer 1997), so that nothing is clipped whatever lies behind the camera:

    e_c = d · (a × b),  e_a = d · (b × c),  e_b = d · (c × a)
    inside: all have the sign of a · (b × c)
    1/z = (e_a + e_b + e_c) / (a · (b × c)),  weights = e / (e_a + e_b + e_c)

Two triangles compute exactly opposite numbers for a common edge, and an edge belongs to both: there
are no cracks. The nearest wins, of equals the first.
"""

import math

import numpy as np

from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.numerics import clamp, cross, dot
from diff4splat.kernels.jit import inlined

NEAR_M = 0.01
"""What is nearer to the camera's plane is not drawn."""


@inlined
def edges(local, triangles, index):
    """Three edge normals, for the weights of the three vertices, and a · (b × c)."""
    i, j, k = triangles[index, 0], triangles[index, 1], triangles[index, 2]
    ax, ay, az = local[i, 0], local[i, 1], local[i, 2]
    bx, by, bz = local[j, 0], local[j, 1], local[j, 2]
    cx, cy, cz = local[k, 0], local[k, 1], local[k, 2]
    first = cross(bx, by, bz, cx, cy, cz)
    second = cross(cx, cy, cz, ax, ay, az)
    third = cross(ax, ay, az, bx, by, bz)
    volume = dot(ax, ay, az, first[0], first[1], first[2])
    return first, second, third, volume


@inlined
def weights(local, triangles, index, x, y):
    """Barycentric weights of the point of a triangle in direction (x, y, 1)."""
    first, second, third, _ = edges(local, triangles, index)
    a = first[0] * x + first[1] * y + first[2]
    b = second[0] * x + second[1] * y + second[2]
    c = third[0] * x + third[1] * y + third[2]
    total = a + b + c
    if not total * total > 0.0:
        return 1.0, 0.0, 0.0
    return a / total, b / total, c / total


@inlined
def bounds(local, triangles, index, near, focal, center):
    """(left, top, right, bottom) in pixels of the part beyond ``near``; empty: right < left.

    Also the range of 1/z, and whether ``near`` cuts it.
    """
    left, top, right, bottom = 1e30, 1e30, -1e30, -1e30
    low, high, cut = 1e300, 0.0, False
    for corner in range(3):
        one, two = triangles[index, corner], triangles[index, (corner + 1) % 3]
        z, other = local[one, 2], local[two, 2]
        if z >= near:
            x, y = local[one, 0] / z, local[one, 1] / z
            left, right = min(left, x), max(right, x)
            top, bottom = min(top, y), max(bottom, y)
            low, high = min(low, 1.0 / z), max(high, 1.0 / z)
        if (z >= near) != (other >= near):
            share = clamp((near - z) / (other - z), 0.0, 1.0)
            x = (local[one, 0] + (local[two, 0] - local[one, 0]) * share) / near
            y = (local[one, 1] + (local[two, 1] - local[one, 1]) * share) / near
            left, right = min(left, x), max(right, x)
            top, bottom = min(top, y), max(bottom, y)
            high, cut = 1.0 / near, True
    return (
        left * focal[0] + center[0],
        top * focal[1] + center[1],
        right * focal[0] + center[0],
        bottom * focal[1] + center[1],
        low,
        high,
        cut,
    )


@inlined
def touch(triangles, index, other):
    """Whether two triangles share a vertex."""
    if index < 0 or other < 0:
        return False
    for i in range(3):
        for j in range(3):
            if triangles[index, i] == triangles[other, j]:
                return True
    return False


@inlined
def within(value, count):
    """A coordinate as an index, held so that neither it nor its neighbours overflow."""
    return math.floor(clamp(value, -2.0, count + 2.0))


@inlined
def _span(normal, offset, left, right):
    """The part of (left, right) where normal x + offset can be positive."""
    if normal > 0.0:
        return max(left, -offset / normal), right
    if normal < 0.0:
        return left, min(right, -offset / normal)
    return (left, right) if offset >= 0.0 else (1.0, -1.0)


@kernel
def rasterise(local, triangles, first, last, grid, near, closest, owners):
    """Draw triangles ``first`` to ``last`` into ``closest`` (1/z, begins at 0) and ``owners``."""
    n = grid.per_side
    rows, columns = closest.shape
    reach = 0.0
    for column in range(min(n, columns)):
        reach = max(reach, abs(grid.bend[column]))
    scale = grid.focal[0] * n
    for index in range(first, last):
        left, top, right, bottom, low, high, cut = bounds(
            local, triangles, index, near, grid.focal, grid.center
        )
        if right < left:
            continue
        begin = max(within(left * n - 1.5, columns), 0)
        end = min(within(right * n + 1.5, columns), columns - 1)
        top_row = max(within(top * n - 1.5, rows), 0)
        last_row = min(within(bottom * n + 1.5, rows), rows - 1)
        if begin > end or top_row > last_row:
            continue
        ea, eb, ec, volume = edges(local, triangles, index)
        if not volume * volume > 0.0:
            continue
        s = 1.0 if volume > 0.0 else -1.0
        ax, ay, az = s * ea[0], s * ea[1], s * ea[2]
        bx, by, bz = s * eb[0], s * eb[1], s * eb[2]
        cx, cy, cz = s * ec[0], s * ec[1], s * ec[2]
        size = abs(volume)
        px, py, pz = (ax + bx + cx) / size, (ay + by + cy) / size, (az + bz + cz) / size
        wide, limit = end - begin > 16, high if cut else math.inf
        for row in range(top_row, last_row + 1):
            y, from_column, to_column = grid.y[row], begin, end
            if wide:
                x0, x1 = (begin / n - grid.center[0]) / grid.focal[0] - 2.0 / scale, 1e30
                x0, x1 = _span(ax, ay * y + az + abs(ay) * reach, x0, x1)
                x0, x1 = _span(bx, by * y + bz + abs(by) * reach, x0, x1)
                x0, x1 = _span(cx, cy * y + cz + abs(cy) * reach, x0, x1)
                from_column = max(
                    within((x0 * grid.focal[0] + grid.center[0]) * n - 2, columns), begin
                )
                to_column = min(within((x1 * grid.focal[0] + grid.center[0]) * n + 2, columns), end)
            phase = row % n
            for column in range(from_column, to_column + 1):
                x, v = grid.x[phase, column], y + grid.bend[column]
                inside = (
                    (ax * x + (ay * v + az) >= 0.0)
                    & (bx * x + (by * v + bz) >= 0.0)
                    & (cx * x + (cy * v + cz) >= 0.0)
                )
                depth = px * x + (py * v + pz)
                inside &= depth <= limit
                depth = min(max(depth, low), high)
                won = inside & (depth > closest[row, column])
                closest[row, column] = depth if won else closest[row, column]
                owners[row, column] = index if won else owners[row, column]


def blank(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """An empty lattice: 1/z of nothing, and no triangle."""
    return np.zeros((rows, columns)), np.full((rows, columns), -1, np.int32)

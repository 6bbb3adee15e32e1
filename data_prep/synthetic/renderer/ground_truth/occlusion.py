"""Kernels: exact occlusion of image points by triangles.

A point is occluded by a triangle in front of it by more than a relative 1e-4, except its
surface triangle and neighbours of that one. Points are sorted by pixel (counting sort), so a
triangle visits only the points in its rows.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera
from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.rasterise import NEAR_M, bounds, edges, touch, within
from diff4splat.kernels.jit import inlined

_IN_FRONT = 1.0 + 1e-4


def visible_points(
    local: Float64[np.ndarray, "v 3"],
    triangles: Int32[np.ndarray, "f 3"],
    lens: RenderCamera,
    points: Float64[np.ndarray, "n 3"],
    point_triangles: Int64[np.ndarray, " n"],
) -> Bool[np.ndarray, " n"]:
    """Whether points (u, v, 1/z) are inside the image, in front of the camera and not occluded.

    1/z is 0 at infinite distance, and negative for invisible points; ``point_triangles`` is the
    triangle that a point lies on, or −1.
    """
    seen = np.zeros(len(points), np.bool_)
    starts = np.zeros(lens.height * lens.width + 1, np.int64)
    order = np.zeros(len(points), np.int64)
    inside = sort_by_pixel(points, lens.height, lens.width, starts, order)
    lists = points[order[:inside]], point_triangles[order[:inside]]
    hidden = np.zeros(inside, np.bool_)
    mark_occluded(local, triangles, lens, starts, *lists, hidden)
    seen[order[:inside]] = ~hidden
    return seen


@inlined
def _pixel(points, index, height, width):
    u, v = points[index, 0], points[index, 1]
    if not (points[index, 2] >= 0.0 and u >= 0.0 and v >= 0.0 and u < width and v < height):
        return -1
    return int(v) * width + int(u)


@kernel
def sort_by_pixel(points, height, width, starts, order):
    """Indices of points by pixel into ``order``; returns how many are in the image."""
    for index in range(len(points)):
        pixel = _pixel(points, index, height, width)
        if pixel >= 0:
            starts[pixel + 1] += 1
    for pixel in range(height * width):
        starts[pixel + 1] += starts[pixel]
    for index in range(len(points)):
        pixel = _pixel(points, index, height, width)
        if pixel >= 0:
            order[starts[pixel]] = index
            starts[pixel] += 1
    for pixel in range(height * width, 0, -1):
        starts[pixel] = starts[pixel - 1]
    starts[0] = 0
    return starts[height * width]


@kernel
def mark_occluded(local, triangles, lens, starts, points, point_triangles, hidden):
    """Mark the sorted ``points`` that triangles occlude."""
    for index in range(len(triangles)):
        left, top, right, bottom, low, high, cut = bounds(
            local, triangles, index, NEAR_M, lens.focal, lens.center
        )
        if right < left:
            continue
        first = max(within(left - 0.01, lens.width), 0)
        last = min(within(right + 0.01, lens.width), lens.width - 1)
        begin = max(within(top - 0.01, lens.height), 0)
        end = min(within(bottom + 0.01, lens.height), lens.height - 1)
        if first > last or begin > end:
            continue
        ea, eb, ec, volume = edges(local, triangles, index)
        if not volume * volume > 0.0:
            continue
        s = 1.0 if volume > 0.0 else -1.0
        for row in range(begin, end + 1):
            start, stop = starts[row * lens.width + first], starts[row * lens.width + last + 1]
            for at in range(start, stop):
                x = (points[at, 0] - lens.center[0]) / lens.focal[0]
                y = (points[at, 1] - lens.center[1]) / lens.focal[1]
                a = s * (ea[0] * x + ea[1] * y + ea[2])
                b = s * (eb[0] * x + eb[1] * y + eb[2])
                c = s * (ec[0] * x + ec[1] * y + ec[2])
                if a >= 0.0 and b >= 0.0 and c >= 0.0:
                    inverse = (a + b + c) / abs(volume)
                    if cut and inverse > high:
                        continue
                    inverse = min(max(inverse, low), high)
                    if inverse > points[at, 2] * _IN_FRONT and not touch(
                        triangles, index, point_triangles[at]
                    ):
                        hidden[at] = True

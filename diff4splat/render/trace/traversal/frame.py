"""The frame of a packet of rays.

Its origin is near those of the rays and its z axis is their mean direction d; e1 and
e2 are across. A ray is slid to the plane z = 0 and scaled to one unit of z:

    point at z = (shift_x + z slope_x, shift_y + z slope_y, z),    τ = (z - start) · stretch

All rays start at start ≥ 0. What lies around a packet's mean ray is small in these numbers, so
float32 keeps what float64 would.
"""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.render.raster.projection.footprint import triple

PACKET = 64
"""Rays in a packet at most."""
SLOPE_X, SLOPE_Y, SHIFT_X, SHIFT_Y, STRETCH, START, SINCE, FARTHEST, LAST = (
    k * PACKET for k in range(9)
)
"""Where the numbers of a packet's rays begin: as above, the time since the frame's, and the largest
τ that is searched (-1 once the ray is done)."""
PLANES = 5
"""Right, left, below, above, in front."""
ROUNDING = 4 * PLANES
"""Index after normals and offsets: how far rounding may move a plane."""


class Frame(NamedTuple):
    """Origin, axes and time, in float64."""

    origin: tuple[float, float, float]
    across: tuple[float, float, float]
    down: tuple[float, float, float]
    ahead: tuple[float, float, float]
    time: float
    early: float
    """The earliest of the rays' times, less the frame's."""
    late: float


@inlined
def dot(a, b):
    """Dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Cross product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def minus(a, b):
    """The difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def plus(a, b, factor):
    """The sum of a and ``factor`` times b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@inlined
def scaled_to_one(a):
    """The unit vector along a."""
    length = math.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


@inlined
def make_frame(rays, first, last):
    """The frame of the rays at ``first`` to ``last`` of the bundle's order."""
    ahead, origin, time = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    share = 1.0 / (last - first)
    base = triple(rays.origins, rays.order[first])
    for place in range(first, last):
        i = rays.order[place]
        ahead = plus(ahead, triple(rays.directions, i), 1.0)
        # Offsets from one of them: sums of large numbers would lose the small ones.
        origin = plus(origin, minus(triple(rays.origins, i), base), share)
        if len(rays.times):
            time += share * np.float64(rays.times[i])
    ahead = scaled_to_one(ahead)
    across = _across(ahead, rays, first, last)
    origin = plus(base, origin, 1.0)
    nearest, early, late = np.inf, 0.0, 0.0
    for place in range(first, last):
        i = rays.order[place]
        nearest = min(nearest, dot(minus(triple(rays.origins, i), origin), ahead))
        if len(rays.times):
            early = min(early, np.float64(rays.times[i]) - time)
            late = max(late, np.float64(rays.times[i]) - time)
    return Frame(
        plus(origin, ahead, nearest), across, cross(ahead, across), ahead, time, early, late
    )


@inlined
def _across(ahead, rays, first, last):
    """Along the step between the first two rays: of pixels, an axis of the image."""
    step = triple(rays.directions, rays.order[min(first + 1, last - 1)])
    step = minus(step, triple(rays.directions, rays.order[first]))
    step = plus(step, ahead, -dot(step, ahead))
    if dot(step, step) > 1e-24:
        return scaled_to_one(step)
    # Any direction that is not along the rays.
    x, y, z = abs(ahead[0]), abs(ahead[1]), abs(ahead[2])
    if x <= y and x <= z:
        return scaled_to_one(cross(ahead, (1.0, 0.0, 0.0)))
    if y <= z:
        return scaled_to_one(cross(ahead, (0.0, 1.0, 0.0)))
    return scaled_to_one(cross(ahead, (0.0, 0.0, 1.0)))


@inlined
def place_rays(rays, first, last, frame, numbers):
    """Fill ``numbers`` (`LAST` values) with the rays in the axes of ``frame``."""
    numbers[:] = 0.0
    numbers[FARTHEST:LAST] = -1.0
    for lane in range(last - first):
        i = rays.order[first + lane]
        direction = triple(rays.directions, i)
        offset = minus(triple(rays.origins, i), frame.origin)
        along, start = dot(direction, frame.ahead), dot(offset, frame.ahead)
        slope_x, slope_y = dot(direction, frame.across) / along, dot(direction, frame.down) / along
        numbers[SLOPE_X + lane], numbers[SLOPE_Y + lane] = slope_x, slope_y
        numbers[SHIFT_X + lane] = dot(offset, frame.across) - start * slope_x
        numbers[SHIFT_Y + lane] = dot(offset, frame.down) - start * slope_y
        numbers[STRETCH + lane], numbers[START + lane] = 1 / along, start
        if len(rays.times):
            numbers[SINCE + lane] = np.float64(rays.times[i]) - frame.time
        numbers[FARTHEST + lane] = np.inf


@inlined
def make_beam(numbers, count, frame, anchor, planes, rows):
    """Planes around all rays: normal (3) and offset each, relative to the tree's anchor.

    A point p is outside where normal · p exceeds the offset. ``rows`` says which corner of a box
    (its row in a node) is the innermost along each axis of each normal.
    """
    origin = minus(frame.origin, anchor)
    room = 4e-6 * (abs(origin[0]) + abs(origin[1]) + abs(origin[2]))
    planes[ROUNDING] = room
    for side in range(PLANES):
        normal, offset = _plane(side, numbers, count, frame)
        offset += dot(normal, origin) + room
        for axis in range(3):
            planes[4 * side + axis] = normal[axis]
            rows[3 * side + axis] = 16 * (axis if normal[axis] > 0 else axis + 3)
        planes[4 * side + 3] = offset


@inlined
def _plane(side, numbers, count, frame):
    """Normal and offset from the frame's origin of one side."""
    if side == PLANES - 1:
        return (-frame.ahead[0], -frame.ahead[1], -frame.ahead[2]), 0.0
    sign = 1.0 if side % 2 == 0 else -1.0
    axis = frame.across if side < 2 else frame.down
    slopes, shifts = (SLOPE_X, SHIFT_X) if side < 2 else (SLOPE_Y, SHIFT_Y)
    slope = shift = -np.inf
    for lane in range(count):
        slope = max(slope, sign * numbers[slopes + lane])
        shift = max(shift, sign * numbers[shifts + lane])
    sideways = (sign * axis[0], sign * axis[1], sign * axis[2])
    # Slopes were rounded to float32.
    slope += 1e-6 * abs(slope)
    shift += 1e-6 * abs(shift)
    return plus(sideways, frame.ahead, -slope), shift

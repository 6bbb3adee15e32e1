"""Projection of a Gaussian to its 2D footprint, and its gradient, in float64.

Same formulas as ``render.projection``: with M = J Wᵀ R S, rows a and b of M, and dilation d,

    vx = |a|² + d,   det = |a × b|² + d (|a|² + |b|² + d),
    whiten_x = h / √vx,   whiten_y = h √(vx / det),   shear = h (a · b) / √(vx det)

where h² = log2(e) / 2 turns the exponent into one of base 2. float64 squares every float32
number without over- or underflow, so nothing is scaled.
"""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.kernels.jit import contracted

HALF_LOG2E = 0.5 / math.log(2)
BASE = math.sqrt(HALF_LOG2E)
LN2 = math.log(2)


class Local(NamedTuple):
    """A mean in camera axes."""

    x: float
    y: float
    z: float


class Axes(NamedTuple):
    """R S: the principal axes as columns, row by row."""

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float


class Slopes(NamedTuple):
    """Rows of J Wᵀ, and where J was taken."""

    x0: float
    x1: float
    x2: float
    y0: float
    y1: float
    y2: float
    tangent_x: float
    tangent_y: float


class Moments(NamedTuple):
    """Rows a, b of M, their cross product, and what the footprint is made of."""

    a0: float
    a1: float
    a2: float
    b0: float
    b1: float
    b2: float
    c0: float
    c1: float
    c2: float
    xx: float
    yy: float
    xy: float
    area2: float
    det: float


@contracted
def triple(rows, i):
    """Row ``i`` of three float32 values, in float64."""
    return np.float64(rows[i, 0]), np.float64(rows[i, 1]), np.float64(rows[i, 2])


@contracted
def quadruple(rows, i):
    """Row ``i`` of four float32 values, in float64."""
    return (
        np.float64(rows[i, 0]),
        np.float64(rows[i, 1]),
        np.float64(rows[i, 2]),
        np.float64(rows[i, 3]),
    )


@contracted
def camera_space(view, mean):
    """Camera coordinates of a world point; subtracting first is exact far from the origin."""
    x, y, z = view.position
    dx, dy, dz = mean[0] - x, mean[1] - y, mean[2] - z
    first, second, third = view.rotation
    return Local(
        dx * first[0] + dy * second[0] + dz * third[0],
        dx * first[1] + dy * second[1] + dz * third[1],
        dx * first[2] + dy * second[2] + dz * third[2],
    )


@contracted
def unit(quat):
    """A unit quaternion and the inverse length; zero is the identity of inverse length 0."""
    w, x, y, z = quat
    squared = w * w + x * x + y * y + z * z
    if squared == 0:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    inverse = 1 / math.sqrt(squared)
    return w * inverse, x * inverse, y * inverse, z * inverse, inverse


@contracted
def principal_axes(quat, scale):
    """R S of what ``unit`` gives, and three standard deviations."""
    w, x, y, z, _ = quat
    s0, s1, s2 = scale
    return Axes(
        (1 - 2 * (y * y + z * z)) * s0,
        2 * (x * y - w * z) * s1,
        2 * (x * z + w * y) * s2,
        2 * (x * y + w * z) * s0,
        (1 - 2 * (x * x + z * z)) * s1,
        2 * (y * z - w * x) * s2,
        2 * (x * z - w * y) * s0,
        2 * (y * z + w * x) * s1,
        (1 - 2 * (x * x + y * y)) * s2,
    )


@contracted
def linearize(view, local):
    """J Wᵀ at a mean, with the tangents held to the guard band."""
    inverse = 1 / local.z
    tx = min(max(local.x * inverse, view.limits_x[0]), view.limits_x[1])
    ty = min(max(local.y * inverse, view.limits_y[0]), view.limits_y[1])
    jx, jy = view.focal_x * inverse, view.focal_y * inverse
    first, second, third = view.rotation
    return Slopes(
        (first[0] - tx * first[2]) * jx,
        (second[0] - tx * second[2]) * jx,
        (third[0] - tx * third[2]) * jx,
        (first[1] - ty * first[2]) * jy,
        (second[1] - ty * second[2]) * jy,
        (third[1] - ty * third[2]) * jy,
        tx,
        ty,
    )


@contracted
def moments(slopes, axes, dilation):
    """The covariance of the footprint without a difference of large numbers."""
    s, r = slopes, axes
    a0 = s.x0 * r.xx + s.x1 * r.yx + s.x2 * r.zx
    a1 = s.x0 * r.xy + s.x1 * r.yy + s.x2 * r.zy
    a2 = s.x0 * r.xz + s.x1 * r.yz + s.x2 * r.zz
    b0 = s.y0 * r.xx + s.y1 * r.yx + s.y2 * r.zx
    b1 = s.y0 * r.xy + s.y1 * r.yy + s.y2 * r.zy
    b2 = s.y0 * r.xz + s.y1 * r.yz + s.y2 * r.zz
    c0, c1, c2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    xx, yy = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2
    xy = a0 * b0 + a1 * b1 + a2 * b2
    area2 = c0 * c0 + c1 * c1 + c2 * c2
    det = area2 + dilation * (xx + yy + dilation)
    return Moments(a0, a1, a2, b0, b1, b2, c0, c1, c2, xx, yy, xy, area2, det)


@contracted
def log2_opacity(moments, opacity, antialias):
    """Logarithm of the opacity at the centre, less what dilation added."""
    if antialias:
        return math.log2(opacity) + 0.5 * math.log2(moments.area2 / moments.det)
    return math.log2(opacity)

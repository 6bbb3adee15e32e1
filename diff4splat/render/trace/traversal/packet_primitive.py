"""A primitive in the axes of a packet: the few numbers that all of its rays share.

Built in float64 from W, kept in float32. The root of what remains across the view needs no
factorisation: W across and W down are normal to S Rᵀ ahead, whose length is the deviation s.
"""

import math

import numpy as np

from diff4splat.kernels.addresses import double_at, put_float
from diff4splat.kernels.jit import inlined
from diff4splat.render.trace.tables import CENTER, MEAN, SCALES, VELOCITY, WHITEN
from diff4splat.render.trace.tables import INV_TIME_SIGMA as INV_TIME_SIGMA_COLUMN
from diff4splat.render.trace.tables import LEVEL as LEVEL_COLUMN
from diff4splat.render.trace.traversal.frame import cross, dot

X, Y, Z, U11, U12, U22, G1, G1X, G1Y, G2, G2Y, S, LEVEL = range(13)
"""Mean (3), root across (3), slopes of the canonical ray (5), deviation along, log2 opacity."""
VX, VY, VZ, TIME_OFFSET, INV_TIME_SIGMA = range(13, 18)
"""Velocity (3), deviations since the centre of the pulse, and deviations per second."""


@inlined
def put_primitive(shape, row, moving, frame):
    """Write the shape at the frame's time of the primitive at ``row``; both are addresses."""
    offset = (
        double_at(row, MEAN) - frame.origin[0],
        double_at(row, MEAN + 1) - frame.origin[1],
        double_at(row, MEAN + 2) - frame.origin[2],
    )
    if moving:
        offset = _put_motion(shape, row, frame, offset)
    h1, h2, h3 = (
        _whitened(row, frame.across),
        _whitened(row, frame.down),
        _whitened(row, frame.ahead),
    )
    s1, s2, s3 = double_at(row, SCALES), double_at(row, SCALES + 1), double_at(row, SCALES + 2)
    normal = (s1 * s1 * h3[0], s2 * s2 * h3[1], s3 * s3 * h3[2])
    deviation, u11 = math.sqrt(dot(normal, normal)), math.sqrt(dot(h1, h1))
    shorter = 1 / u11
    # The determinant of W is 1 / (s1 s2 s3): no difference of products.
    u12, u22 = dot(h1, h2) * shorter, deviation * shorter / (s1 * s2 * s3)
    _put(shape, X, dot(offset, frame.across))
    _put(shape, Y, dot(offset, frame.down))
    _put(shape, Z, dot(offset, frame.ahead))
    _put(shape, U11, u11)
    _put(shape, U12, u12)
    _put(shape, U22, u22)
    _put(shape, G1, deviation * dot(h1, h3) * shorter)
    _put(shape, G1X, deviation * u11)
    _put(shape, G1Y, deviation * u12)
    _put(shape, G2, dot(cross(normal, h1), h3) * shorter)
    _put(shape, G2Y, deviation * u22)
    _put(shape, S, deviation)
    _put(shape, LEVEL, double_at(row, LEVEL_COLUMN))


@inlined
def _put(shape, column, value):
    put_float(shape, column, np.float32(value))


@inlined
def _whitened(row, v):
    """W v."""
    return (
        _component(row, WHITEN, v),
        _component(row, WHITEN + 3, v),
        _component(row, WHITEN + 6, v),
    )


@inlined
def _component(row, at, v):
    return double_at(row, at) * v[0] + double_at(row, at + 1) * v[1] + double_at(row, at + 2) * v[2]


@inlined
def _put_motion(shape, row, frame, offset):
    """The offset of the mean at the frame's time; velocity and pulse go to the shape."""
    since, inv_sigma = frame.time - double_at(row, CENTER), double_at(row, INV_TIME_SIGMA_COLUMN)
    velocity = (
        double_at(row, VELOCITY),
        double_at(row, VELOCITY + 1),
        double_at(row, VELOCITY + 2),
    )
    _put(shape, VX, dot(velocity, frame.across))
    _put(shape, VY, dot(velocity, frame.down))
    _put(shape, VZ, dot(velocity, frame.ahead))
    _put(shape, TIME_OFFSET, since * inv_sigma)
    _put(shape, INV_TIME_SIGMA, inv_sigma)
    return (
        offset[0] + since * velocity[0],
        offset[1] + since * velocity[1],
        offset[2] + since * velocity[2],
    )

"""Kernels of the features of one level, sixteen channels at a time, and of their gradients.

Axes: ``n`` points, ``t`` times, ``c`` channels; all arrays are flat float32. Planes are ``rj ri c``
and lines (planes with time, at one time) ``t r c``; features are ``t n f``, those of this level
from ``feature``. With P, Q, R the planes without time and X, Y, Z the lines at a point

    feature_t = P Q R X_t Y_t Z_t
    dP = Q R Σ_t g_t X_t Y_t Z_t        dX_t = g_t P Q R Y_t Z_t        (and so on)

A gradient kernel owns its channels of all planes of the level: two of them never write one number.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff4splat.kernels.jit import contracted
from diff4splat.kernels.simd16 import fill, total
from diff4splat.kernels.simd_memory import load, store
from diff4splat.scene.motion.hexplane.jit import kernel

Floats = NDArray[np.float32]


class Planes(NamedTuple):
    """The values, or the gradients, of one level."""

    xy: Floats
    xz: Floats
    yz: Floats
    x: Floats
    """Lines along x, of the plane xt."""
    y: Floats
    z: Floats


class Shape(NamedTuple):
    """Sizes of one level, and which of its channels to work on."""

    x: int
    """Nodes along x."""
    y: int
    z: int
    times: int
    points: int
    channels: int
    """Of each plane."""
    channel: int
    """First of the sixteen."""
    features: int
    """Of all levels."""
    feature: int
    """Where the first channel is written."""


@contracted
def _place(unit, nodes):
    """Lower node, step to the upper one, its weight, and how fast the point moves the weight."""
    last = np.float32(nodes - 1)
    raw = unit * last
    # As written NaN passes both comparisons and stays NaN, with an index that is valid.
    inside = raw >= 0 and raw <= last
    position = np.float32(0) if raw < 0 else (last if raw > last else raw)
    lower = min(int(position), max(nodes - 2, 0)) if position >= 0 else 0
    return lower, min(1, nodes - 1), position - np.float32(lower), last if inside else np.float32(0)


@contracted
def _corners(plane, start, right, down, column, row):
    """Value at a place, and its slopes along columns and rows."""
    a, c = load(plane, start), load(plane, start + down)
    top, bottom = load(plane, start + right) - a, load(plane, start + down + right) - c
    low, high = a + top * column, c + bottom * column
    return low + (high - low) * row, top + (bottom - top) * row, high - low


@contracted
def _ends(line, start, right, weight):
    """Value at a place, and its slope."""
    a = load(line, start)
    slope = load(line, start + right) - a
    return a + slope * weight, slope


@contracted
def _add(array, place, value):
    store(array, place, load(array, place) + value)


@contracted
def _add_corners(plane, start, right, down, column, row, value):
    below = value * row
    above = value - below
    _add(plane, start, above - above * column)
    _add(plane, start + right, above * column)
    _add(plane, start + down, below - below * column)
    _add(plane, start + down + right, below * column)


@contracted
def _add_ends(line, start, right, weight, value):
    _add(line, start, value - value * weight)
    _add(line, start + right, value * weight)


@contracted
def _slope(values, scale):
    # Not only a product: a point that is no number lies on no slope.
    return total(values) * scale if scale > 0 else np.float32(0)


@kernel
def read(first, last, unit, planes, shape, features):
    """Write sixteen channels of the features of some points."""
    pitch = shape.channels
    for point in range(first, last):
        x, right_x, wx, _ = _place(unit[3 * point], shape.x)
        y, right_y, wy, _ = _place(unit[3 * point + 1], shape.y)
        z, right_z, wz, _ = _place(unit[3 * point + 2], shape.z)
        right_x, right_y, right_z = right_x * pitch, right_y * pitch, right_z * pitch
        wide_x, wide_y = shape.x * pitch, shape.y * pitch
        at_x, at_y = x * pitch + shape.channel, y * pitch + shape.channel
        at_z = z * pitch + shape.channel
        xy, _, _ = _corners(planes.xy, y * wide_x + at_x, right_x, right_y * shape.x, wx, wy)
        xz, _, _ = _corners(planes.xz, z * wide_x + at_x, right_x, right_z * shape.x, wx, wz)
        yz, _, _ = _corners(planes.yz, z * wide_y + at_y, right_y, right_z * shape.y, wy, wz)
        still = xy * xz * yz
        for time in range(shape.times):
            along_x, _ = _ends(planes.x, time * wide_x + at_x, right_x, wx)
            along_y, _ = _ends(planes.y, time * wide_y + at_y, right_y, wy)
            along_z, _ = _ends(planes.z, time * shape.z * pitch + at_z, right_z, wz)
            made = still * along_x * along_y * along_z
            store(features, (time * shape.points + point) * shape.features + shape.feature, made)


@kernel
def accumulate(unit, planes, shape, incoming, out, to_unit):
    """Add to the gradients of planes and lines, and write those of points, for all points."""
    pitch = shape.channels
    wide_x, wide_y, wide_z = shape.x * pitch, shape.y * pitch, shape.z * pitch
    for point in range(shape.points):
        x, right_x, wx, scale_x = _place(unit[3 * point], shape.x)
        y, right_y, wy, scale_y = _place(unit[3 * point + 1], shape.y)
        z, right_z, wz, scale_z = _place(unit[3 * point + 2], shape.z)
        at_x, at_y = x * pitch + shape.channel, y * pitch + shape.channel
        at_z = z * pitch + shape.channel
        down_xy, down_xz, down_yz = right_y * wide_x, right_z * wide_x, right_z * wide_y
        right_x, right_y, right_z = right_x * pitch, right_y * pitch, right_z * pitch
        at_xy, at_xz, at_yz = y * wide_x + at_x, z * wide_x + at_x, z * wide_y + at_y
        xy, xy_x, xy_y = _corners(planes.xy, at_xy, right_x, down_xy, wx, wy)
        xz, xz_x, xz_z = _corners(planes.xz, at_xz, right_x, down_xz, wx, wz)
        yz, yz_y, yz_z = _corners(planes.yz, at_yz, right_y, down_yz, wy, wz)
        still, moved = xy * xz * yz, fill(np.float32(0))
        to_x, to_y, to_z = fill(np.float32(0)), fill(np.float32(0)), fill(np.float32(0))
        for time in range(shape.times):
            line_x, line_y = time * wide_x + at_x, time * wide_y + at_y
            line_z = time * wide_z + at_z
            along_x, slope_x = _ends(planes.x, line_x, right_x, wx)
            along_y, slope_y = _ends(planes.y, line_y, right_y, wy)
            along_z, slope_z = _ends(planes.z, line_z, right_z, wz)
            place = (time * shape.points + point) * shape.features + shape.feature
            given = load(incoming, place)
            pair = along_x * along_y
            moved = moved + given * (pair * along_z)
            given = given * still
            of_x, of_y, of_z = (
                given * (along_y * along_z),
                given * (along_x * along_z),
                given * pair,
            )
            _add_ends(out.x, line_x, right_x, wx, of_x)
            _add_ends(out.y, line_y, right_y, wy, of_y)
            _add_ends(out.z, line_z, right_z, wz, of_z)
            to_x, to_y, to_z = to_x + of_x * slope_x, to_y + of_y * slope_y, to_z + of_z * slope_z
        of_xy, of_xz, of_yz = moved * (xz * yz), moved * (xy * yz), moved * (xy * xz)
        _add_corners(out.xy, at_xy, right_x, down_xy, wx, wy, of_xy)
        _add_corners(out.xz, at_xz, right_x, down_xz, wx, wz, of_xz)
        _add_corners(out.yz, at_yz, right_y, down_yz, wy, wz, of_yz)
        to_unit[3 * point] = _slope(to_x + of_xy * xy_x + of_xz * xz_x, scale_x)
        to_unit[3 * point + 1] = _slope(to_y + of_xy * xy_y + of_yz * yz_y, scale_y)
        to_unit[3 * point + 2] = _slope(to_z + of_xz * xz_z + of_yz * yz_z, scale_z)

"""The way back of a colour: to the harmonics, and to the direction in which they are seen."""

import math

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, fill, fma
from diff4splat.render.trace.frame import dot
from diff4splat.render.trace.sums import (
    COLOR,
    DIRECT,
    LATE_DIRECT,
    LOBES,
    TO_DIRECTION,
    TO_ORIGIN,
    TO_TIME,
    add,
    add_three,
    three_at,
)
from diff4splat.render.trace.tables import CENTER, MOVING_COLUMNS, VELOCITY
from diff4splat.render.trace.tint import toward
from diff4splat.render.trace.vectors import double_at, float_at, lanes_at, put_lanes


@inlined
def plain_backward(row, pulls):
    """Add the gradient of a colour without harmonics to the row of its primitive."""
    add_three(row, COLOR, pulls, 1.0)


@inlined
def lobes_backward(tint, i, lobes, pulls):
    """Add to the row of harmonics of primitive ``i``; returns the gradient of the basis by lane."""
    basis, own = lanes_at(tint.basis, 0), fill(0.0)
    for channel in range(3):
        at, slope = channel * LANES, np.float32(pulls[channel])
        put_lanes(lobes, at, fma(basis, slope, lanes_at(lobes, at)))
        own = fma(lanes_at(tint.colors, i * LOBES + at), slope, own)
    return own


@inlined
def turn_backward(tint, basis_grad, ray_row):
    """From the gradient of the basis (an address of sixteen) to the direction of the ray."""
    add_three(ray_row, TO_DIRECTION, _turned(tint, basis_grad), 1.0)


@inlined
def toward_backward(tint, i, ray, basis_grad, row, ray_row):
    """The same to origin and mean, between which the direction lies."""
    away = toward(tint, i, ray)
    squared, turned = dot(away, away), _turned(tint, basis_grad)
    if squared == 0:
        return
    inside, length = dot(turned, away) / squared, math.sqrt(squared)
    pull = (
        (turned[0] - inside * away[0]) / length,
        (turned[1] - inside * away[1]) / length,
        (turned[2] - inside * away[2]) / length,
    )
    add_three(row, DIRECT, pull, 1.0)
    add_three(ray_row, TO_ORIGIN, pull, -1.0)
    if tint.columns == MOVING_COLUMNS:
        table = tint.table + 8 * tint.columns * i
        since = np.float64(float_at(tint.times, ray)) - double_at(table, CENTER)
        add_three(row, LATE_DIRECT, pull, since)
        add(ray_row, TO_TIME, dot(three_at(table, VELOCITY), pull))


@inlined
def _turned(tint, basis_grad):
    """Gradient of the direction from that of the basis."""
    x = y = z = 0.0
    for k in range(tint.bands):
        pull = np.float64(float_at(basis_grad, k))
        x += pull * tint.brush.slopes[k, 0]
        y += pull * tint.brush.slopes[k, 1]
        z += pull * tint.brush.slopes[k, 2]
    return x, y, z

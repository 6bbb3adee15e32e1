"""Gradients of a colour: to the harmonics and to the viewing direction."""

import math

import numpy as np

from diff4splat.kernels.addresses import double_at, float_at, lanes_at, put_lanes
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, fill, fma
from diff4splat.render.trace.shading.gradient_sums import (
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
from diff4splat.render.trace.shading.sh_color import mean_direction
from diff4splat.render.trace.tables import CENTER, MOVING_COLUMNS, VELOCITY
from diff4splat.render.trace.traversal.frame import dot


@inlined
def plain_backward(row, pulls):
    """Add the gradient of a colour without harmonics to the row of its primitive."""
    add_three(row, COLOR, pulls, 1.0)


@inlined
def lobes_backward(tables, i, lobes, pulls):
    """Add to the row of harmonics of primitive ``i``; returns the gradient of the basis by lane."""
    basis, slopes = lanes_at(tables.basis, 0), fill(0.0)
    for channel in range(3):
        at, slope = channel * LANES, np.float32(pulls[channel])
        put_lanes(lobes, at, fma(basis, slope, lanes_at(lobes, at)))
        slopes = fma(lanes_at(tables.colors, i * LOBES + at), slope, slopes)
    return slopes


@inlined
def evaluate_sh_backward(tables, basis_grad, ray_row):
    """From the gradient of the basis (an address of sixteen) to the direction of the ray."""
    add_three(ray_row, TO_DIRECTION, _direction_gradient(tables, basis_grad), 1.0)


@inlined
def mean_direction_backward(tables, i, ray, basis_grad, row, ray_row):
    """The same to origin and mean, which define the direction."""
    away = mean_direction(tables, i, ray)
    squared, turned = dot(away, away), _direction_gradient(tables, basis_grad)
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
    if tables.columns == MOVING_COLUMNS:
        table = tables.table + 8 * tables.columns * i
        since = np.float64(float_at(tables.times, ray)) - double_at(table, CENTER)
        add_three(row, LATE_DIRECT, pull, since)
        add(ray_row, TO_TIME, dot(three_at(table, VELOCITY), pull))


@inlined
def _direction_gradient(tables, basis_grad):
    """Gradient of the direction from that of the basis."""
    x = y = z = 0.0
    for k in range(tables.bands):
        pull = np.float64(float_at(basis_grad, k))
        x += pull * tables.workspace.slopes[k, 0]
        y += pull * tables.workspace.slopes[k, 1]
        z += pull * tables.workspace.slopes[k, 2]
    return x, y, z

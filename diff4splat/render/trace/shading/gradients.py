"""Kernels: sums per primitive to gradients of the Gaussians and of their motion, in float64.

With W = S⁻¹ Rᵀ and ∂L/∂W = B S Rᵀ, B symmetric, scale i has the gradient -B_ii / s_i, and a turn by
ω about the axes of the Gaussian has the component B_23 (s_3 / s_2 - s_2 / s_3) about the first, and
so on around. A quaternion q turns by ω as q ⊗ (1, ω / 2).
"""

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.render.raster.projection.footprint import quadruple, triple, unit
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.response import THINNEST
from diff4splat.render.trace.shading.gradient_sums import (
    DIRECT,
    LATE_A,
    LATE_DIRECT,
    LATE_E,
    LATER_E,
    A,
    B,
    E,
)
from diff4splat.render.trace.tables import INV_TIME_SIGMA, SCALES, VELOCITY, WHITEN


@kernel
def add_rows(low, high, listed, rows, totals):
    """Add ``rows`` of those listed Gaussians that are at least ``low`` and below ``high``."""
    for place in range(len(listed)):
        i = listed[place]
        if low <= i < high:
            for column in range(rows.shape[1]):
                totals[i, column] += rows[place, column]


@kernel
def finish(first, last, cloud, primitives, totals, grads):
    """Gradients of Gaussians ``first`` to ``last`` from their sums."""
    for i in range(first, last):
        if totals[i, E] != 0 or totals[i, A] != 0 or totals[i, DIRECT] != 0:
            for axis in range(3):
                pull = _transposed(primitives, i, totals, A, axis)
                grads.means[i, axis] = totals[i, DIRECT + axis] - pull
            _finish_scales(i, cloud, totals, grads)
            _finish_quat(i, cloud, primitives, totals, grads)
            grads.opacities[i] = totals[i, E] / np.float64(cloud.opacities[i])


@inlined
def _transposed(primitives, i, totals, column, axis):
    """A component of Wᵀ times three sums."""
    pull = 0.0
    for row in range(3):
        pull += primitives[i, WHITEN + 3 * row + axis] * totals[i, column + row]
    return pull


@inlined
def _finish_scales(i, cloud, totals, grads):
    scales = triple(cloud.scales, i)
    diagonal = (totals[i, B], totals[i, B + 3], totals[i, B + 5])
    for axis in range(3):
        if abs(scales[axis]) >= THINNEST:
            grads.scales[i, axis] = -diagonal[axis] / scales[axis]


@inlined
def _finish_quat(i, cloud, primitives, totals, grads):
    """Through R(q) and the normalisation of q; a zero quaternion has no gradient."""
    w, x, y, z, inverse = unit(quadruple(cloud.quats, i))
    s1, s2, s3 = primitives[i, SCALES], primitives[i, SCALES + 1], primitives[i, SCALES + 2]
    a = 2 * inverse * totals[i, B + 4] * (s3 / s2 - s2 / s3)
    b = 2 * inverse * totals[i, B + 2] * (s1 / s3 - s3 / s1)
    c = 2 * inverse * totals[i, B + 1] * (s2 / s1 - s1 / s2)
    grads.quats[i, 0] = -x * a - y * b - z * c
    grads.quats[i, 1] = w * a + y * c - z * b
    grads.quats[i, 2] = w * b + z * a - x * c
    grads.quats[i, 3] = w * c + x * b - y * a


@kernel
def finish_motion(first, last, primitives, totals, grads):
    """Gradients of velocities, centres and deviations of the pulses."""
    for i in range(first, last):
        inv_sigma, pull = primitives[i, INV_TIME_SIGMA], 0.0
        for axis in range(3):
            to_mean = totals[i, DIRECT + axis] - _transposed(primitives, i, totals, A, axis)
            to_velocity = totals[i, LATE_DIRECT + axis] - _transposed(
                primitives, i, totals, LATE_A, axis
            )
            grads.velocities[i, axis] = to_velocity
            pull += primitives[i, VELOCITY + axis] * to_mean
        grads.centers[i] = totals[i, LATE_E] * inv_sigma**2 - pull
        grads.deviations[i] = totals[i, LATER_E] * inv_sigma**3

"""Kernel: Gaussians to primitives in float64, and the boxes around them.

W = S⁻¹ Rᵀ, reach k the distance in standard deviations at which a Gaussian ends (0 is invisible):
k = √(2 ln(o / cutoff)) for kernel degree 2, (18 ln(o / cutoff))^¼ for degree 4. The tight box of
the ellipsoid has half sizes k √Σ_jj.
"""

import math

import numpy as np

from diff4splat.kernels.jit import inlined
from diff4splat.render.raster.projection.footprint import (
    LN2,
    principal_axes,
    quadruple,
    triple,
    unit,
)
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.response import THINNEST
from diff4splat.render.trace.tables import (
    CENTER,
    INV_TIME_SIGMA,
    LEVEL,
    MEAN,
    SCALES,
    VELOCITY,
    WHITEN,
)


@kernel
def prepare(first, last, cloud, motion, rules, primitives, reach):
    """Fill the rows of ``primitives`` and ``reach`` of Gaussians ``first`` to ``last``."""
    for i in range(first, last):
        opacity = np.float64(cloud.opacities[i])
        reach[i] = 0.0
        if opacity > 0 and math.log2(opacity) >= rules.log2_cutoff:
            level = math.log2(opacity)
            reach[i] = _reach(level, rules)
            _fill(primitives, i, cloud, level)
            if len(motion.velocities):
                _fill_motion(primitives, i, motion)


@inlined
def _reach(level, rules):
    drop = min((level - rules.log2_cutoff) * LN2, rules.least_drop)
    return math.sqrt(math.sqrt(18 * drop)) if rules.quartic else math.sqrt(2 * drop)


@inlined
def _fill(primitives, i, cloud, level):
    mean, scales = triple(cloud.means, i), triple(cloud.scales, i)
    turn = principal_axes(unit(quadruple(cloud.quats, i)), (1.0, 1.0, 1.0))
    columns = (turn.xx, turn.yx, turn.zx, turn.xy, turn.yy, turn.zy, turn.xz, turn.yz, turn.zz)
    for axis in range(3):
        scale = max(abs(scales[axis]), THINNEST)
        primitives[i, MEAN + axis] = mean[axis]
        primitives[i, SCALES + axis] = scale
        for column in range(3):
            primitives[i, WHITEN + 3 * axis + column] = columns[3 * axis + column] / scale
    primitives[i, LEVEL] = level


@inlined
def _fill_motion(primitives, i, motion):
    velocity = triple(motion.velocities, i)
    for axis in range(3):
        primitives[i, VELOCITY + axis] = velocity[axis]
    primitives[i, CENTER] = motion.centers[i]
    primitives[i, INV_TIME_SIGMA] = 1 / np.float64(motion.deviations[i])


@kernel
def box(first, last, primitives, reach, interval, lower, upper):
    """Corners of the boxes that hold primitives in an interval of time; empty if invisible.

    The mean moves in a line and the shape stays, so the boxes at both ends bound it exactly.
    """
    for i in range(first, last):
        for axis in range(3):
            lower[i, axis], upper[i, axis] = np.inf, -np.inf
            if reach[i] > 0:
                half = reach[i] * _deviation(primitives, i, axis)
                begin = end = primitives[i, MEAN + axis]
                if primitives.shape[1] > VELOCITY:
                    center = primitives[i, CENTER]
                    begin += primitives[i, VELOCITY + axis] * (interval[0] - center)
                    end += primitives[i, VELOCITY + axis] * (interval[1] - center)
                lower[i, axis], upper[i, axis] = min(begin, end) - half, max(begin, end) + half


@inlined
def _deviation(primitives, i, axis):
    """√Σ_jj: the standard deviation along a world axis."""
    total = 0.0
    for row in range(3):
        part = primitives[i, WHITEN + 3 * row + axis] * primitives[i, SCALES + row]
        total += (part * primitives[i, SCALES + row]) ** 2
    return math.sqrt(total)

"""Kernel: Gaussians to footprints, for a piece of the cloud.

Left out are Gaussians with a parameter that is not finite or too large to be squared, those behind
the near plane, those fainter than the cutoff, those that miss all pixel centres, and those thinner
than a millionth of a pixel.
"""

import math

import numpy as np

from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.projection.footprint import (
    BASE,
    LN2,
    camera_space,
    linearize,
    log2_opacity,
    moments,
    principal_axes,
    quadruple,
    triple,
    unit,
)
from diff4splat.render.raster.tables import (
    CENTER_X,
    CENTER_Y,
    EXTENT_X,
    EXTENT_Y,
    LOG2_OPACITY,
    SHEAR,
    WHITEN_X,
    WHITEN_Y,
)

LARGEST = 3.4028234663852886e38**0.5
_THINNEST_PX = 1e-6
# The cutoff is decided per pixel; a box a shade too large never decides it.
_ROOM, _ROOM_PX = 1.0001, 1e-3
MEANS, QUATS, SCALES, OPACITIES, SH = range(5)
"""Columns of the count of unusable parameters."""


@kernel
def project(first, last, candidates, inputs, outputs):
    """Fill the footprint and depth of the visible ``candidates``; returns how many there are.

    They are listed in ``outputs.visible`` from ``first`` on.
    """
    cloud, sh, view, rules = inputs
    prints, depth, visible, unusable = outputs
    count = 0
    for place in range(first, last):
        i = candidates[place]
        mean, quat = triple(cloud.means, i), quadruple(cloud.quats, i)
        state = (mean, quat, triple(cloud.scales, i), np.float64(cloud.opacities[i]))
        if is_visible(i, state, sh, view, rules, prints, depth, unusable):
            visible[first + count] = i
            count += 1
    return count


@contracted
def is_visible(i, state, sh, view, rules, prints, depth, unusable):
    """Whether a Gaussian leaves a footprint; counts it where a parameter cannot be used."""
    fault = _unusable_parameter(state, sh, i)
    if fault >= 0:
        unusable[fault] += 1
        return False
    return _leave_print(i, state, view, rules, prints, depth)


@contracted
def _unusable_parameter(state, sh, i):
    """The first parameter that is not finite or overflows when squared, or -1."""
    mean, quat, scales, opacity = state
    if not _usable(mean):
        return MEANS
    if not _usable(quat):
        return QUATS
    if not _usable(scales):
        return SCALES
    if not abs(opacity) < LARGEST:
        return OPACITIES
    fine = True
    for column in range(sh.shape[1]):
        fine = fine and abs(sh[i, column]) < LARGEST
    return -1 if fine else SH


@contracted
def _usable(values):
    fine = True
    for value in values:
        fine = fine and abs(value) < LARGEST
    return fine


@contracted
def _leave_print(i, state, view, rules, prints, depth):
    """Whether a Gaussian is visible, by its mean, quaternion, scales and opacity.

    If so, its footprint goes to row ``i``.
    """
    mean, quat, scales, opacity = state
    local = camera_space(view, mean)
    if not (local.z > rules.near_depth and opacity > 0):
        return False
    axes = principal_axes(unit(quat), scales)
    m = moments(linearize(view, local), axes, rules.dilation_px2)
    vx, vy = m.xx + rules.dilation_px2, m.yy + rules.dilation_px2
    if not m.det > _THINNEST_PX**2 * (vx + vy):
        return False
    level = log2_opacity(m, opacity, rules.antialias)
    if not level >= rules.log2_cutoff:
        return False
    radius = _ROOM * math.sqrt(2 * LN2 * (level - rules.log2_cutoff))
    extent_x, extent_y = radius * math.sqrt(vx) + _ROOM_PX, radius * math.sqrt(vy) + _ROOM_PX
    x = view.focal_x * local.x / local.z + view.center_x
    y = view.focal_y * local.y / local.z + view.center_y
    if not (_touches(x, extent_x, view.width) and _touches(y, extent_y, view.height)):
        return False
    whiten_y = BASE * math.sqrt(vx / m.det)
    prints[i, CENTER_X], prints[i, CENTER_Y], prints[i, LOG2_OPACITY] = x, y, level
    prints[i, WHITEN_X], prints[i, WHITEN_Y] = BASE / math.sqrt(vx), whiten_y
    prints[i, SHEAR] = m.xy / vx * whiten_y
    prints[i, EXTENT_X], prints[i, EXTENT_Y] = extent_x, extent_y
    depth[i] = local.z
    return True


@contracted
def _touches(center, extent, size):
    """Whether an interval reaches the first or the last pixel centre, or one between."""
    return center + extent >= 0.5 and center - extent <= size - 0.5

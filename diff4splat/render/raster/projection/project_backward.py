"""Kernel: gradients of footprints to those of the Gaussians and of the camera, in float64.

The chain of ``footprint`` from the end: shape → moments → rows of J Wᵀ and R S → mean, quaternion,
scales and camera. Nothing is saved by the forward pass: computing it again is cheaper.
"""

import math

import numpy as np

from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.projection.footprint import (
    BASE,
    LN2,
    Axes,
    camera_space,
    linearize,
    moments,
    principal_axes,
    quadruple,
    triple,
    unit,
)
from diff4splat.render.raster.tables import (
    CENTER_X,
    CENTER_Y,
    LOG2_OPACITY,
    SHEAR,
    WHITEN_X,
    WHITEN_Y,
)

POSE, POSITION, FOCAL, CENTER, CAMERA_COLUMNS = 0, 9, 12, 14, 16
"""Where the camera's gradient lies: rotation row by row, position, focal lengths, centre."""


@kernel
def project_backward(first, last, listed, cloud, view, rules, prints, sums, grads, camera):
    """Gradients of the Gaussians in ``listed[first:last]``; adds those of the ``camera`` (16)."""
    for place in range(first, last):
        _one(listed[place], cloud, view, rules, prints, sums, grads, camera)


@contracted
def _one(index, cloud, view, rules, prints, sums, grads, camera):
    """Gradients of one Gaussian."""
    turned, scales = unit(quadruple(cloud.quats, index)), triple(cloud.scales, index)
    mean = triple(cloud.means, index)
    local = camera_space(view, mean)
    slopes = linearize(view, local)
    turn, axes = principal_axes(turned, (1.0, 1.0, 1.0)), principal_axes(turned, scales)
    grad = _shape_gradient(prints, sums, index)
    a, b = _moments_backward(moments(slopes, axes, rules.dilation_px2), grad, rules)
    to_axes = _axes_backward(slopes, a, b)
    _scales_backward(turn, to_axes, grads.scales, index)
    _quat_backward(turned, scales, to_axes, grads.quats, index)
    grads.opacities[index] = grad[LOG2_OPACITY] / (LN2 * np.float64(cloud.opacities[index]))
    to_row_x, to_row_y = _slopes_backward(axes, a, b)
    to_x, z_from_x = _horizontal(view, local, slopes, to_row_x, grad[CENTER_X], camera)
    to_y, z_from_y = _vertical(view, local, slopes, to_row_y, grad[CENTER_Y], camera)
    _mean_backward(view, (to_x, to_y, z_from_x + z_from_y), mean, grads.means, index, camera)


@contracted
def _shape_gradient(prints, sums, i):
    """Gradients of the first six columns of a footprint, from the moments of its pixels."""
    a, k, b = prints[i, WHITEN_X], prints[i, SHEAR], prints[i, WHITEN_Y]
    e, eu, euu = np.float64(sums[i, 0]), np.float64(sums[i, 1]), np.float64(sums[i, 2])
    ev, euv, evv = np.float64(sums[i, 3]), np.float64(sums[i, 4]), np.float64(sums[i, 5])
    return (
        2 * LN2 * (a * eu - k * ev),
        2 * LN2 * b * ev,
        -2 * LN2 * euu / a,
        2 * LN2 * euv / a,
        -2 * LN2 * (evv + k * euv / a) / b,
        LN2 * e,
    )


@contracted
def _moments_backward(m, grad, rules):
    """Gradients of the rows a and b of M."""
    d = rules.dilation_px2
    vx = m.xx + d
    root = math.sqrt(vx * m.det)
    whiten_x, whiten_y, shear = (
        BASE / math.sqrt(vx),
        BASE * math.sqrt(vx / m.det),
        BASE * m.xy / root,
    )
    on_x, on_y = grad[WHITEN_X] * whiten_x, grad[WHITEN_Y] * whiten_y
    on_shear = grad[SHEAR] * shear
    to_xx = 0.5 * (on_y - on_x - on_shear) / vx
    to_det = -0.5 * (on_y + on_shear) / m.det
    to_xy = grad[SHEAR] * BASE / root
    to_area2 = 0.0
    if rules.antialias:
        to_area2 = 0.5 * grad[LOG2_OPACITY] / (LN2 * m.area2)
        to_det -= 0.5 * grad[LOG2_OPACITY] / (LN2 * m.det)
    to_area2 += to_det
    to_xx += d * to_det
    to_yy = d * to_det
    c0, c1, c2 = 2 * to_area2 * m.c0, 2 * to_area2 * m.c1, 2 * to_area2 * m.c2
    to_a = (
        m.b1 * c2 - m.b2 * c1 + 2 * to_xx * m.a0 + to_xy * m.b0,
        m.b2 * c0 - m.b0 * c2 + 2 * to_xx * m.a1 + to_xy * m.b1,
        m.b0 * c1 - m.b1 * c0 + 2 * to_xx * m.a2 + to_xy * m.b2,
    )
    to_b = (
        c1 * m.a2 - c2 * m.a1 + 2 * to_yy * m.b0 + to_xy * m.a0,
        c2 * m.a0 - c0 * m.a2 + 2 * to_yy * m.b1 + to_xy * m.a1,
        c0 * m.a1 - c1 * m.a0 + 2 * to_yy * m.b2 + to_xy * m.a2,
    )
    return to_a, to_b


@contracted
def _axes_backward(slopes, a, b):
    """Gradient of R S from those of the rows of M."""
    s = slopes
    return Axes(
        s.x0 * a[0] + s.y0 * b[0],
        s.x0 * a[1] + s.y0 * b[1],
        s.x0 * a[2] + s.y0 * b[2],
        s.x1 * a[0] + s.y1 * b[0],
        s.x1 * a[1] + s.y1 * b[1],
        s.x1 * a[2] + s.y1 * b[2],
        s.x2 * a[0] + s.y2 * b[0],
        s.x2 * a[1] + s.y2 * b[1],
        s.x2 * a[2] + s.y2 * b[2],
    )


@contracted
def _scales_backward(turn, grad, out, i):
    """Column by column, R · ∂(R S)."""
    out[i, 0] = turn.xx * grad.xx + turn.yx * grad.yx + turn.zx * grad.zx
    out[i, 1] = turn.xy * grad.xy + turn.yy * grad.yy + turn.zy * grad.zy
    out[i, 2] = turn.xz * grad.xz + turn.yz * grad.yz + turn.zz * grad.zz


@contracted
def _quat_backward(quat, scales, grad, out, i):
    """Through R(q) and the normalisation of q; a zero quaternion has no gradient."""
    w, x, y, z, inverse = quat
    s0, s1, s2 = scales
    xx, xy, xz = grad.xx * s0, grad.xy * s1, grad.xz * s2
    yx, yy, yz = grad.yx * s0, grad.yy * s1, grad.yz * s2
    zx, zy, zz = grad.zx * s0, grad.zy * s1, grad.zz * s2
    to_w = 2 * (x * (zy - yz) + y * (xz - zx) + z * (yx - xy))
    to_x = 2 * (y * (xy + yx) + z * (xz + zx) + w * (zy - yz) - 2 * x * (yy + zz))
    to_y = 2 * (x * (xy + yx) + z * (yz + zy) + w * (xz - zx) - 2 * y * (xx + zz))
    to_z = 2 * (x * (xz + zx) + y * (yz + zy) + w * (yx - xy) - 2 * z * (xx + yy))
    along = to_w * w + to_x * x + to_y * y + to_z * z
    out[i, 0], out[i, 1] = inverse * (to_w - along * w), inverse * (to_x - along * x)
    out[i, 2], out[i, 3] = inverse * (to_y - along * y), inverse * (to_z - along * z)


@contracted
def _slopes_backward(axes, a, b):
    """Gradients of the two rows of J Wᵀ."""
    r = axes
    return (
        (
            a[0] * r.xx + a[1] * r.xy + a[2] * r.xz,
            a[0] * r.yx + a[1] * r.yy + a[2] * r.yz,
            a[0] * r.zx + a[1] * r.zy + a[2] * r.zz,
        ),
        (
            b[0] * r.xx + b[1] * r.xy + b[2] * r.xz,
            b[0] * r.yx + b[1] * r.yy + b[2] * r.yz,
            b[0] * r.zx + b[1] * r.zy + b[2] * r.zz,
        ),
    )


@contracted
def _mean_backward(view, grad, mean, out, i, camera):
    """From camera to world axes, for the mean and the pose."""
    for row in range(3):
        w = view.rotation[row]
        gradient = grad[0] * w[0] + grad[1] * w[1] + grad[2] * w[2]
        out[i, row] = gradient
        camera[POSITION + row] -= gradient
        away = mean[row] - view.position[row]
        for column in range(3):
            camera[POSE + 3 * row + column] += grad[column] * away


@contracted
def _horizontal(view, local, slopes, to_row, to_center, camera):
    """Gradients of x and z of a mean through the x axis of the image."""
    first, second, third = view.rotation
    lens = (view.focal_x, view.limits_x)
    return _axis_backward(
        0,
        lens,
        (first[0], second[0], third[0]),
        (first[2], second[2], third[2]),
        (local.x, local.z, slopes.tangent_x),
        to_row,
        to_center,
        camera,
    )


@contracted
def _vertical(view, local, slopes, to_row, to_center, camera):
    """The same of y and z through the y axis."""
    first, second, third = view.rotation
    lens = (view.focal_y, view.limits_y)
    return _axis_backward(
        1,
        lens,
        (first[1], second[1], third[1]),
        (first[2], second[2], third[2]),
        (local.y, local.z, slopes.tangent_y),
        to_row,
        to_center,
        camera,
    )


@contracted
def _axis_backward(axis, lens, across, forward, place, to_row, to_center, camera):
    """``across`` and ``forward`` are columns of the pose, ``place`` is (x or y, z, tangent)."""
    focal, (low, high) = lens
    coordinate, z, tangent = place
    scale, to_scale, to_tangent = focal / z, 0.0, 0.0
    for row in range(3):
        to_scale += to_row[row] * (across[row] - tangent * forward[row])
        to_tangent -= to_row[row] * forward[row] * scale
        camera[POSE + 3 * row + axis] += to_row[row] * scale
        camera[POSE + 3 * row + 2] -= to_row[row] * scale * tangent
    slope = coordinate / z
    camera[FOCAL + axis] += to_center * slope + to_scale / z
    camera[CENTER + axis] += to_center
    to_slope = to_center * focal
    if low <= slope <= high:
        to_slope += to_tangent
    else:
        # The tangent is held to a limit, which moves with the lens.
        camera[CENTER + axis] -= to_tangent / focal
        camera[FOCAL + axis] -= to_tangent * tangent / focal
    return to_slope / z, -(to_slope * slope + to_scale * scale) / z

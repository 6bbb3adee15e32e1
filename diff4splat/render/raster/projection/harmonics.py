"""Kernels: spherical harmonics to RGB from a viewpoint, and gradients, for listed Gaussians.

colour = max(0, 0.5 + Σ_k sh_k Y_k(d)), d the unit vector from the camera to the mean. Order, signs
and constants as in ``scene.harmonics``. Only the bands that the scene has are evaluated.
"""

import math

import numpy as np

from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.projection.footprint import triple

_C0 = 0.28209479177387814
_C1 = 0.4886025119029199
_C2 = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
_C3 = (
    0.5900435899266435,
    2.890611442640554,
    0.4570457994644658,
    0.3731763325901154,
    1.445305721320277,
)


@kernel
def colors(first, last, listed, means, sh, position, values):
    """RGB of the Gaussians in ``listed[first:last]`` into the first three columns of ``values``."""
    basis, slopes = np.empty(16), np.empty((16, 3))
    basis[0] = _C0
    for place in range(first, last):
        i = listed[place]
        if sh.shape[1] > 1:
            evaluate(triple(means, i), position, sh.shape[1], basis, slopes)
        for channel in range(3):
            values[i, channel] = max(_color(basis, sh, i, channel), 0.0)


@kernel
def colors_backward(
    first, last, listed, means, sh, position, value_grads, sh_grads, mean_grads, camera
):
    """Gradients of coefficients, and through the direction of means and ``camera`` position (3)."""
    basis, slopes, turn = np.empty(16), np.empty((16, 3)), np.empty(3)
    for place in range(first, last):
        i = listed[place]
        distance = evaluate(triple(means, i), position, sh.shape[1], basis, slopes)
        turn[:] = 0
        for channel in range(3):
            if _color(basis, sh, i, channel) >= 0:
                gradient = np.float64(value_grads[i, channel])
                sh_grads[i, 0, channel] = gradient * _C0
                for k in range(1, sh.shape[1]):
                    sh_grads[i, k, channel] = gradient * basis[k]
                    for axis in range(3):
                        turn[axis] += gradient * sh[i, k, channel] * slopes[k, axis]
        if distance > 0:
            _turn_backward(triple(means, i), position, distance, turn, mean_grads, i, camera)


@contracted
def _color(basis, sh, i, channel):
    value = 0.5
    for k in range(sh.shape[1]):
        value += basis[k] * sh[i, k, channel]
    return value


@contracted
def _turn_backward(mean, position, distance, turn, mean_grads, i, camera):
    """Through the normalisation of the direction: only its sideways part turns it."""
    along = 0.0
    for axis in range(3):
        along += turn[axis] * (mean[axis] - position[axis]) / distance
    for axis in range(3):
        direction = (mean[axis] - position[axis]) / distance
        gradient = (turn[axis] - along * direction) / distance
        mean_grads[i, axis] += gradient
        camera[axis] -= gradient


@contracted
def evaluate(mean, position, count, basis, slopes):
    """Basis functions and their gradients in the direction of a mean; returns the distance."""
    basis[0] = _C0
    if count == 1:
        return 0.0
    x, y, z = mean[0] - position[0], mean[1] - position[1], mean[2] - position[2]
    distance = math.sqrt(x * x + y * y + z * z)
    if distance > 0:
        x, y, z = x / distance, y / distance, z / distance
    _put(basis, slopes, 1, -_C1 * y, 0.0, -_C1, 0.0)
    _put(basis, slopes, 2, _C1 * z, 0.0, 0.0, _C1)
    _put(basis, slopes, 3, -_C1 * x, -_C1, 0.0, 0.0)
    if count > 4:
        _second(basis, slopes, x, y, z)
    if count > 9:
        _third(basis, slopes, x, y, z)
    return distance


@contracted
def _put(basis, slopes, k, value, along_x, along_y, along_z):
    basis[k] = value
    slopes[k, 0], slopes[k, 1], slopes[k, 2] = along_x, along_y, along_z


@contracted
def _second(basis, slopes, x, y, z):
    a, b, c = _C2
    _put(basis, slopes, 4, a * x * y, a * y, a * x, 0.0)
    _put(basis, slopes, 5, -a * y * z, 0.0, -a * z, -a * y)
    _put(basis, slopes, 6, b * (2 * z * z - x * x - y * y), -2 * b * x, -2 * b * y, 4 * b * z)
    _put(basis, slopes, 7, -a * x * z, -a * z, 0.0, -a * x)
    _put(basis, slopes, 8, c * (x * x - y * y), 2 * c * x, -2 * c * y, 0.0)


@contracted
def _third(basis, slopes, x, y, z):
    a, b, c, d, e = _C3
    xx, yy, zz = x * x, y * y, z * z
    ring = 4 * zz - xx - yy
    _put(basis, slopes, 9, -a * y * (3 * xx - yy), -6 * a * x * y, -3 * a * (xx - yy), 0.0)
    _put(basis, slopes, 10, b * x * y * z, b * y * z, b * x * z, b * x * y)
    _put(basis, slopes, 11, -c * y * ring, 2 * c * x * y, -c * (ring - 2 * yy), -8 * c * y * z)
    _put(
        basis,
        slopes,
        12,
        d * z * (2 * zz - 3 * xx - 3 * yy),
        -6 * d * x * z,
        -6 * d * y * z,
        d * (6 * zz - 3 * xx - 3 * yy),
    )
    _put(basis, slopes, 13, -c * x * ring, -c * (ring - 2 * xx), 2 * c * x * y, -8 * c * x * z)
    _put(basis, slopes, 14, e * z * (xx - yy), 2 * e * x * z, -2 * e * y * z, e * (xx - yy))
    _put(basis, slopes, 15, -a * x * (xx - 3 * yy), -3 * a * (xx - yy), 6 * a * x * y, 0.0)

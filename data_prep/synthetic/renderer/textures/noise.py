"""Noise from hashed integers: values, gradients, sums of octaves, cells.

Coordinates count features; ``footprint`` is how many of them one sample averages over. Octaves that
are finer than the footprint fade out, so that nothing flickers. Natural images have amplitudes
that fall like 1/f (Field 1987): octaves of equal strength.
"""

import math

from diff4splat.data_prep.synthetic.renderer.numerics import clamp, clamped
from diff4splat.kernels.jit import inlined, shared

_X, _Y, _Z = 0x1E3779B97F4A7C15, 0x42B2AE3D27D4EB4F, 0x165667B19E3779F9
_MIX, _AGAIN = 0x3F58476D1CE4E5B9, 0x14D049BB133111EB
_LACUNARITY = 1.97
"""A little off 2: lattices of octaves never line up."""


@inlined
def mixed(value):
    """An integer whose bits all depend on all bits of ``value``."""
    value = (value ^ (value >> 30)) * _MIX
    value = (value ^ (value >> 27)) * _AGAIN
    return value ^ (value >> 31)


@inlined
def hashed(column, row, seed):
    """A hash of a lattice point."""
    return mixed(column * _X + row * _Y + seed * _Z)


@inlined
def fraction(bits, shift):
    """16 bits of a hash as a number from 0 to 1."""
    return ((bits >> shift) & 0xFFFF) * (1.0 / 65535.0)


@inlined
def _scrambled(value):
    """As `mixed`, good enough for lattice points whose coordinates are multiplied already."""
    value = (value ^ (value >> 32)) * _MIX
    return value ^ (value >> 29)


@inlined
def _slope(bits, x, y, z):
    """A hashed gradient times an offset."""
    gx = ((bits >> 8) & 0x3FF) - 511.5
    gy = ((bits >> 22) & 0x3FF) - 511.5
    gz = ((bits >> 36) & 0x3FF) - 511.5
    return gx * x + gy * y + gz * z


@inlined
def _slope_flat(bits, x, y):
    return (((bits >> 12) & 0x3FF) - 511.5) * x + (((bits >> 34) & 0x3FF) - 511.5) * y


@inlined
def _fade(part):
    return part * part * part * (part * (part * 6.0 - 15.0) + 10.0)


@inlined
def _between(first, second, share):
    return first + (second - first) * share


@shared
def noise(x, y, z, seed):
    """Gradient noise (Perlin 2002) with mean 0 and a standard deviation near 0.25."""
    x, y, z = clamped(x), clamped(y), clamped(z)
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    a, b, c = int(fx) * _X, int(fy) * _Y, int(fz) * _Z + seed * _AGAIN
    x, y, z = x - fx, y - fy, z - fz
    u, v, w = _fade(x), _fade(y), _fade(z)
    total = 0.0
    for layer in range(2):
        upper = _between(
            _slope(_scrambled(a + b + c), x, y, z),
            _slope(_scrambled(a + _X + b + c), x - 1.0, y, z),
            u,
        )
        lower = _between(
            _slope(_scrambled(a + b + _Y + c), x, y - 1.0, z),
            _slope(_scrambled(a + _X + b + _Y + c), x - 1.0, y - 1.0, z),
            u,
        )
        total += _between(upper, lower, v) * (w if layer else 1.0 - w)
        c, z = c + _Z, z - 1.0
    return total * (1.0 / 512.0)


@shared
def flat_noise(x, y, seed):
    """Gradient noise of the plane with mean 0 and a standard deviation near 0.25."""
    x, y = clamped(x), clamped(y)
    fx, fy = math.floor(x), math.floor(y)
    a, b = int(fx) * _X + seed * _AGAIN, int(fy) * _Y
    x, y = x - fx, y - fy
    u = _fade(x)
    upper = _between(
        _slope_flat(_scrambled(a + b), x, y), _slope_flat(_scrambled(a + _X + b), x - 1.0, y), u
    )
    lower = _between(
        _slope_flat(_scrambled(a + b + _Y), x, y - 1.0),
        _slope_flat(_scrambled(a + _X + b + _Y), x - 1.0, y - 1.0),
        u,
    )
    return _between(upper, lower, _fade(y)) * (1.0 / 512.0)


@shared
def octaves(x, y, z, footprint, seed, count):
    """Up to ``count`` octaves of equal strength, the first with features of size 1.

    Standard deviation near 1 where none is faded out.
    """
    total, size, weight = 0.0, 1.0, 4.0 / math.sqrt(float(count))
    for octave in range(count):
        strength = clamp(1.75 - 2.0 * footprint / size, 0.0, 1.0)
        if strength <= 0.0:
            break
        total += strength * noise(x / size, y / size, z / size, seed + octave * 7919)
        # A quarter turn about the diagonal, so that lattices of octaves differ in direction too.
        x, y, z = z + 0.31, x - 0.17, y + 0.73
        size /= _LACUNARITY
    return total * weight


@shared
def flat_octaves(x, y, footprint, seed, count):
    """As `octaves`, on a plane."""
    total, size, weight = 0.0, 1.0, 4.0 / math.sqrt(float(count))
    for octave in range(count):
        strength = clamp(1.75 - 2.0 * footprint / size, 0.0, 1.0)
        if strength <= 0.0:
            break
        total += strength * flat_noise(x / size, y / size, seed + octave * 7919)
        # Turned by the angle of a 3 : 4 : 5 triangle.
        x, y = 0.8 * x - 0.6 * y + 0.31, 0.6 * x + 0.8 * y - 0.17
        size /= _LACUNARITY
    return total * weight


@shared
def cells(x, y, jitter, seed):
    """Nearest and second nearest of scattered points (Worley 1996).

    Returns both distances, the offset to the nearest and its hash.
    """
    x, y = clamped(x), clamped(y)
    column, row = math.floor(x), math.floor(y)
    first, second, dx, dy, found = 8.0, 8.0, 0.0, 0.0, 0
    for j in range(row - 1, row + 2):
        for i in range(column - 1, column + 2):
            bits = hashed(i, j, seed)
            px = i + 0.5 + jitter * (fraction(bits, 4) - 0.5) - x
            py = j + 0.5 + jitter * (fraction(bits, 24) - 0.5) - y
            square = px * px + py * py
            if square < first:
                second, first, dx, dy, found = first, square, px, py, bits
            elif square < second:
                second = square
    return math.sqrt(first), math.sqrt(second), dx, dy, found

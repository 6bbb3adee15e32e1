"""Small functions of one number, by sums, products and roots only.

Libraries differ in the last bit of an exponential or a sine; these do not.
"""

import math

from diff4splat.kernels.jit import inlined

_FAR = 1e8
"""Coordinates beyond are held here: their fractions would be gone, and integers overflow later."""


@inlined
def clamp(value, low, high):
    """``value`` held between ``low`` and ``high``; NaN becomes ``low``."""
    if not value > low:
        return low
    return high if value > high else value


@inlined
def blend(first, second, share):
    """From ``first`` at 0 to ``second`` at 1."""
    return first + (second - first) * share


@inlined
def ramp(value, low, high):
    """0 up to ``low``, 1 from ``high``, with zero slope at both ends."""
    share = clamp((value - low) / (high - low), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


@inlined
def step(distance, width):
    """1 where ``distance`` is positive, averaged over a footprint of ``width``."""
    return clamp(distance / (width + 1e-9) + 0.5, 0.0, 1.0)


@inlined
def fading(size, footprint):
    """1 for features much larger than the footprint, 0 for those that it averages away."""
    return clamp(1.75 - 2.0 * footprint / size, 0.0, 1.0)


@inlined
def exponential(value):
    """The exponential function: e to the power of ``value`` (held within ±60), to about 1e-9."""
    part = clamp(value, -60.0, 60.0) / 1024.0
    result = 1.0 + part * (1.0 + part * (0.5 + part * (1 / 6 + part * (1 / 24 + part / 120))))
    for _ in range(10):
        result = result * result
    return result


@inlined
def wave(turns):
    """Sine of ``turns`` full turns, to about 1e-3: a parabola, corrected once."""
    part = turns - math.floor(turns)
    arch = 8.0 * (part - 0.5) * (abs(part - 0.5) * 2.0 - 1.0)
    return arch * (0.775 + 0.225 * abs(arch))


@inlined
def clamped(coordinate):
    """A coordinate whose floor is an integer that fits."""
    return clamp(coordinate, -_FAR, _FAR)


@inlined
def dot(ax, ay, az, bx, by, bz):
    """Scalar product."""
    return ax * bx + ay * by + az * bz


@inlined
def cross(ax, ay, az, bx, by, bz):
    """Vector product; exactly the opposite when the factors change places."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined
def unit(x, y, z):
    """The same direction with length 1; zero stays zero."""
    length = math.sqrt(x * x + y * y + z * z)
    scale = 1.0 / length if length > 1e-150 else 0.0
    return x * scale, y * scale, z * scale

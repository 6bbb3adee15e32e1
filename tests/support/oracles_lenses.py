"""Lenses written from their formulas, one direction or point at a time, in Python floats."""

import math
from collections.abc import Callable, Sequence

Point = tuple[float, float]
Direction = tuple[float, float, float]


def polar_direction(angle: float, azimuth: float) -> Direction:
    """The unit vector at an angle from the forward axis."""
    return (
        math.sin(angle) * math.cos(azimuth),
        math.sin(angle) * math.sin(azimuth),
        math.cos(angle),
    )


def fisheye_point(direction: Direction, k: Sequence[float]) -> Point:
    """OpenCV's fisheye model."""
    x, y, z = direction
    angle = math.atan2(math.sqrt(x * x + y * y), z)
    radius = angle + sum(k[i] * angle ** (2 * i + 3) for i in range(4))
    azimuth = math.atan2(y, x)
    return radius * math.cos(azimuth), radius * math.sin(azimuth)


def blender_direction(point: Point, k: Sequence[float], cycles_signs: bool = False) -> Direction:
    """Blender's fisheye polynomial; the sign of the angle as in Cycles on demand."""
    radius = math.hypot(*point)
    angle = sum(k[i] * radius**i for i in range(5))
    return polar_direction(-angle if cycles_signs else angle, math.atan2(point[1], point[0]))


def opencv_point(
    direction: Direction, k: Sequence[float], p: Sequence[float], s: Sequence[float]
) -> Point:
    """OpenCV's rational, tangential and thin-prism distortion."""
    x, y = direction[0] / direction[2], direction[1] / direction[2]
    r2 = x**2 + y**2
    radial = (1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3) / (
        1 + k[3] * r2 + k[4] * r2**2 + k[5] * r2**3
    )
    return (
        x * radial + 2 * p[0] * x * y + p[1] * (r2 + 2 * x**2) + s[0] * r2 + s[1] * r2**2,
        y * radial + p[0] * (r2 + 2 * y**2) + 2 * p[1] * x * y + s[2] * r2 + s[3] * r2**2,
    )


def first_fall(function: Callable[[float], float], upper: float, steps: int = 200_000) -> float:
    """Where a function first stops rising on (0, upper], by looking; ``upper`` if nowhere."""
    before = function(0.0)
    for i in range(1, steps + 1):
        now = function(upper * i / steps)
        if not now > before:
            return upper * (i - 1) / steps
        before = now
    return upper

"""Bodies of revolution and superquadrics.

A profile is a row of (radius, height) points from the top to the bottom; a body may have several,
and where one ends and the next begins there is a sharp edge. Superquadric (Barr 1981):
x = c(v, e) c(u, f), z = c(v, e) s(u, f), height = s(v, e) with c(a, e) = sign(cos a) |cos a|^e.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    grid_triangles,
    merged,
    outward,
    surface,
)


def revolved(profiles: list[list[tuple[float, float]]], segments: int = 24) -> Surface:
    """A closed body whose profiles join and end on the axis."""
    return outward(merged(*(_band(np.array(profile), segments) for profile in profiles)))


def half_around(segments: int) -> Float64[np.ndarray, " n"]:
    """Angle that runs to π and back."""
    angle = np.arange(segments) * (2 * np.pi / segments)
    return np.pi - np.abs(angle - np.pi)


def _band(profile: Float64[np.ndarray, "m 2"], segments: int) -> Surface:
    angle = np.arange(segments) * (2 * np.pi / segments)
    radius, height = profile[:, :1], profile[:, 1:]
    ring = np.stack(
        [
            radius * np.cos(angle),
            np.broadcast_to(-height, (len(profile), segments)),
            radius * np.sin(angle),
        ],
        -1,
    )
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    u = half_around(segments) * max(float(profile[:, 0].mean()), 1e-6)
    uv = np.stack(np.broadcast_arrays(u[None], along[:, None]), -1)
    band = surface(
        ring.reshape(-1, 3), grid_triangles(len(profile), segments, closed=True), uv.reshape(-1, 2)
    )
    return _with_poles(band, radius[:, 0] < 1e-9, segments)


def _with_poles(band: Surface, on_axis: Bool[np.ndarray, " m"], segments: int) -> Surface:
    """Rings of no radius become one vertex, and triangles without area go."""
    number = np.arange(len(band.vertices))
    ring = number // segments
    number = np.where(on_axis[ring], ring * segments, number)
    kept, renumbered = np.unique(number, return_inverse=True)
    triangles = renumbered[band.triangles].astype(np.int32)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (a != c)]
    return surface(band.vertices[kept], triangles, band.uv[kept])


def arc(
    center: tuple[float, float], radius: float, degrees: tuple[float, float], steps: int
) -> list[tuple[float, float]]:
    """Profile points on a circle; 90 is its top, 0 its outermost point."""
    angle = np.radians(np.linspace(*degrees, steps))
    points = np.stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)], -1)
    points[np.abs(points) < 1e-12] = 0.0
    return [(float(x), float(y)) for x, y in points]


def ball(radius: float, segments: int = 24) -> Surface:
    """A sphere that stands on y = 0."""
    return revolved([arc((0.0, radius), radius, (90.0, -90.0), segments // 2 + 1)], segments)


def rod(radius: float, height: float, *, bevel: float = 0.0, segments: int = 16) -> Surface:
    """An upright cylinder; a bevel breaks its edges."""
    if bevel <= 0:
        rim_top, rim_bottom = (radius, height), (radius, 0.0)
        return revolved(
            [[(0.0, height), rim_top], [rim_top, rim_bottom], [rim_bottom, (0.0, 0.0)]], segments
        )
    corners = [
        (0.0, height),
        (radius - bevel, height),
        (radius, height - bevel),
        (radius, bevel),
        (radius - bevel, 0.0),
        (0.0, 0.0),
    ]
    return revolved([list(pair) for pair in pairwise(corners)], segments)


def smooth_profile(points: list[tuple[float, float]], steps: int = 6) -> list[tuple[float, float]]:
    """A Catmull–Rom curve through the points; radii stay at least 0."""
    knots = np.array([points[0], *points, points[-1]])
    u = np.arange(steps)[:, None] / steps
    pieces = [_catmull_rom(knots[i : i + 4], u) for i in range(len(points) - 1)]
    curve = np.concatenate([*pieces, knots[-1:]])
    curve[:, 0] = np.maximum(curve[:, 0], 0.0)
    return [(float(r), float(h)) for r, h in curve]


def _catmull_rom(
    knots: Float64[np.ndarray, "4 2"], u: Float64[np.ndarray, "n 1"]
) -> Float64[np.ndarray, "n 2"]:
    a, b, c, d = knots
    return 0.5 * (
        2 * b + (c - a) * u + (2 * a - 5 * b + 4 * c - d) * u**2 + (3 * b - a - 3 * c + d) * u**3
    )


def superquadric(exponents: tuple[float, float], segments: int = 28) -> Surface:
    """A body between box, ball and double cone, of height 1; exponents (upright, around)."""
    profile = np.array(arc((0.0, 0.0), 1.0, (90.0, -90.0), segments // 2 + 1))
    upright = np.sign(profile) * np.abs(profile) ** exponents[0]
    upright[[0, -1], 0] = 0.0
    body = _band(0.5 * upright, segments)
    flat = body.vertices[:, [0, 2]]
    radius = np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
    unit = flat / radius
    bent = np.sign(unit) * np.abs(unit) ** exponents[1] * radius
    vertices = np.stack([bent[:, 0], body.vertices[:, 1] - 0.5, bent[:, 1]], -1)
    return outward(surface(vertices, body.triangles, body.uv))

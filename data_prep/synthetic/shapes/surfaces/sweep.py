"""Tubes along a path, rings, lumps of stone and leaves.

Noise is a sum of plane waves, so it is smooth, cheap and the same at every resolution.
"""

from functools import cache

import numpy as np
from jaxtyping import Float64, Int32

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import half_around
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    grid_triangles,
    outward,
    surface,
)


def tube(
    path: Float64[np.ndarray, "m 3"], radii: Float64[np.ndarray, " m"], segments: int = 10
) -> Surface:
    """A closed tube along ``path``; its ends are points where the radius is 0, else flat."""
    ends = np.concatenate([path[:1], path, path[-1:]]), np.concatenate([[0.0], radii, [0.0]])
    points, sizes = ends
    side, other = _frames(path)
    angle = np.arange(segments) * (2 * np.pi / segments)
    around = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    around = np.concatenate([around[:1], around, around[-1:]])
    ring = points[:, None] + sizes[:, None, None] * around
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    u = half_around(segments) * max(float(radii.mean()), 1e-6)
    uv = np.stack(np.broadcast_arrays(u[None], along[:, None]), -1).reshape(-1, 2)
    return outward(_capped(ring, uv, segments))


def _capped(
    ring: Float64[np.ndarray, "m n 3"], uv: Float64[np.ndarray, "v 2"], segments: int
) -> Surface:
    """The first and the last ring are single points."""
    rows = len(ring)
    triangles = grid_triangles(rows, segments, closed=True)
    number = np.arange(rows * segments)
    number[:segments] = 0
    number[-segments:] = (rows - 1) * segments
    kept, renumbered = np.unique(number, return_inverse=True)
    triangles = renumbered[triangles].astype(np.int32)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (a != c)]
    return surface(ring.reshape(-1, 3)[kept], triangles, uv[kept])


def _frames(
    path: Float64[np.ndarray, "m 3"],
) -> tuple[Float64[np.ndarray, "m 3"], Float64[np.ndarray, "m 3"]]:
    tangent = np.gradient(path, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    # an axis that no tangent comes near keeps the tube from twisting
    least = np.abs(tangent).max(0).argmin()
    side = np.cross(tangent, np.eye(3)[least])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    return side, np.cross(tangent, side)


def torus(major: float, minor: float, segments: tuple[int, int] = (32, 14)) -> Surface:
    """A ring that stands upright on y = 0 with its axis along z."""
    n, m = segments
    around = np.arange(n)[:, None] * (2 * np.pi / n)
    tube_angle = np.arange(m)[None] * (2 * np.pi / m)
    radius = major + minor * np.cos(tube_angle)
    ring = np.stack(
        [
            radius * np.cos(around),
            radius * np.sin(around) - major - minor,
            np.broadcast_to(minor * np.sin(tube_angle), (n, m)),
        ],
        -1,
    )
    uv = np.stack(
        np.broadcast_arrays(half_around(n)[:, None] * major, half_around(m)[None] * minor), -1
    )
    triangles = grid_triangles(n + 1, m, closed=True) % (n * m)
    return outward(surface(ring.reshape(-1, 3), triangles, uv.reshape(-1, 2)))


def plane_waves(
    points: Float64[np.ndarray, "*b 3"], rng: Rng, frequency: float, octaves: int = 3
) -> Float64[np.ndarray, "*b"]:
    """Smooth noise, mostly within -1 and 1; ``frequency`` in waves per metre."""
    total = np.zeros(points.shape[:-1])
    for octave in range(octaves):
        direction = rng.normal(6, 3) * (frequency * 2.0**octave)
        phase = rng.uniform_array(0.0, 2 * np.pi, 6)
        total += (0.5**octave / 3.0) * np.sin(points @ direction.T * 3.6 + phase).sum(-1)
    return total


@cache
def _icosphere(level: int) -> tuple[Float64[np.ndarray, "v 3"], Int32[np.ndarray, "f 3"]]:
    gold = (1 + 5**0.5) / 2
    points = [(s, t * gold, 0.0) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    vertices = np.array([np.roll(point, k) for k in range(3) for point in points])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    near = 2.0 / np.sqrt(1 + gold**2) + 1e-6
    close = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1) < near
    triangles = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if close[i, j] and close[j, k] and close[i, k]
    ]
    faces = np.array(triangles, np.int32)
    inward = np.linalg.det(vertices[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    for _ in range(level):
        vertices, faces = _subdivided(vertices, faces)
    return vertices, faces


def _subdivided(
    vertices: Float64[np.ndarray, "v 3"], faces: Int32[np.ndarray, "f 3"]
) -> tuple[Float64[np.ndarray, "w 3"], Int32[np.ndarray, "g 3"]]:
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    edges, which = np.unique(sides, axis=0, return_inverse=True)
    middle = vertices[edges].sum(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = (which.reshape(3, -1) + len(vertices)).astype(np.int32)
    a, b, c = faces.T
    new = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
    return np.concatenate([vertices, middle]), new.transpose(0, 2, 1).reshape(-1, 3)


def lump(rng: Rng, *, roughness: float, level: int = 3, frequency: float = 0.45) -> Surface:
    """A ball of radius 1 around the origin, displaced by noise."""
    unit, triangles = _icosphere(level)
    vertices = unit * (1 + roughness * plane_waves(unit, rng, frequency))[:, None]
    return surface(vertices, triangles, 2.0 * np.stack([unit[:, 0] + unit[:, 2], unit[:, 1]], -1))


def leaves(
    centers: Float64[np.ndarray, "n 3"], sizes: Float64[np.ndarray, " n"], rng: Rng
) -> Surface:
    """One folded leaf of four corners per point, turned at random but mostly facing up."""
    count = len(centers)
    along = rng.normal(count, 3) + np.array([0.0, 0.25, 0.0])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6)
    across = np.cross(along, rng.normal(count, 3) * 0.6 + np.array([0.0, -1.0, 0.0]))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-6)
    fold = np.cross(along, across)
    length = sizes[:, None]
    corners = [
        centers - 0.5 * length * along,
        centers + 0.28 * length * across + 0.1 * length * fold,
        centers + 0.5 * length * along,
        centers - 0.28 * length * across + 0.1 * length * fold,
    ]
    first = 4 * np.arange(count)[:, None]
    triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])]).astype(
        np.int32
    )
    uv = np.array([[0.0, -0.5], [0.28, 0.0], [0.0, 0.5], [-0.28, 0.0]])
    flat = (uv[None] * sizes[:, None, None] + rng.uniform_array(0.0, 3.0, count, 1, 2)).reshape(
        -1, 2
    )
    return surface(np.stack(corners, 1).reshape(-1, 3), triangles, flat)

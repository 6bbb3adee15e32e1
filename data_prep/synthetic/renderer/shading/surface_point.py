"""Where a ray meets a triangle: position, normals and texture coordinates."""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.numerics import cross, dot, unit
from diff4splat.data_prep.synthetic.renderer.rasterise import weights
from diff4splat.kernels.jit import inlined


class Surfaces(NamedTuple):
    """All triangles at one time, as seen by one camera."""

    positions: np.ndarray
    local: np.ndarray
    normals: np.ndarray
    rest: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray
    owners: np.ndarray


class Hit(NamedTuple):
    """The point of a triangle in direction (x, y, 1) of camera axes."""

    triangle: int
    owner: int
    x: float
    y: float
    vertices: tuple[int, int, int]
    weights: tuple[float, float, float]
    """Barycentric."""
    position: tuple[float, float, float]
    """In world axes."""


@inlined
def world_ray(axes, x, y):
    """Unit direction of (x, y, 1) in world axes, and the length of (x, y, 1)."""
    wx = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2]
    wy = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2]
    wz = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2]
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    return (wx / length, wy / length, wz / length), length


@inlined
def hit_at(index, x, y, surfaces):
    """The point of triangle ``index`` in direction (x, y, 1)."""
    triangles = surfaces.triangles
    vertices = (triangles[index, 0], triangles[index, 1], triangles[index, 2])
    barycentric = weights(surfaces.local, triangles, index, x, y)
    position = _mixed(surfaces.positions, vertices, barycentric)
    return Hit(index, surfaces.owners[index], x, y, vertices, barycentric, position)


@inlined
def depth_at(hit, local):
    """Z of the point in camera axes."""
    i, j, k = hit.vertices
    a, b, c = hit.weights
    return local[i, 2] * a + local[j, 2] * b + local[k, 2] * c


@inlined
def face_normal(hit, ray, positions):
    """Unit normal of the triangle, on the visible side."""
    i, j, k = hit.vertices
    ax, ay, az = positions[i, 0], positions[i, 1], positions[i, 2]
    x, y, z = cross(
        positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az,
        positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az,
    )  # fmt: skip
    x, y, z = unit(x, y, z)
    if dot(x, y, z, ray[0], ray[1], ray[2]) > 0.0:
        return -x, -y, -z
    return x, y, z


@inlined
def smooth_normal(hit, face, normals):
    """Interpolated vertex normal on the side of ``face``; ``face`` where the two are at odds."""
    nx, ny, nz = _mixed(normals, hit.vertices, hit.weights)
    nx, ny, nz = unit(nx, ny, nz)
    side = dot(nx, ny, nz, face[0], face[1], face[2])
    if side < 0.0:
        nx, ny, nz = -nx, -ny, -nz
    if abs(side) > 1e-3:
        return nx, ny, nz
    return face


@inlined
def texture_coordinates(hit, surfaces, materials):
    """Where the texture is looked up, in features."""
    scale = materials.scale[hit.owner]
    if materials.solid[hit.owner]:
        u, v, w = _mixed(surfaces.rest, hit.vertices, hit.weights)
        return u * scale, v * scale, w * scale
    i, j, k = hit.vertices
    a, b, c = hit.weights
    u = surfaces.uv[i, 0] * a + surfaces.uv[j, 0] * b + surfaces.uv[k, 0] * c
    v = surfaces.uv[i, 1] * a + surfaces.uv[j, 1] * b + surfaces.uv[k, 1] * c
    return u * scale, v * scale, 0.5


@inlined
def _mixed(values, vertices, barycentric):
    """Rows of three numbers per vertex, at a point."""
    i, j, k = vertices
    a, b, c = barycentric
    return (
        values[i, 0] * a + values[j, 0] * b + values[k, 0] * c,
        values[i, 1] * a + values[j, 1] * b + values[k, 1] * c,
        values[i, 2] * a + values[j, 2] * b + values[k, 2] * c,
    )

"""Bodies with flat faces and sharp edges: bevelled boxes, extruded outlines, slabs.

Every polygon has vertices of its own. Texture coordinates of a face are metres along its own
horizontal and vertical, or (x, z) where it lies flat.
"""

from functools import cache

import numpy as np
from jaxtyping import Float64, Int32

from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface, merged, outward, surface


def planar_uv(
    vertices: Float64[np.ndarray, "v 3"], normals: Float64[np.ndarray, "v 3"]
) -> Float64[np.ndarray, "v 2"]:
    """Metres along flat faces, given the normal at each vertex."""
    level = np.hypot(normals[:, 0], normals[:, 2])
    safe = np.maximum(level, 1e-12)
    along = (vertices[:, 2] * normals[:, 0] - vertices[:, 0] * normals[:, 2]) / safe
    upright = np.stack([along, vertices[:, 1]], -1)
    is_flat = np.abs(normals[:, 1]) > level
    return np.where(is_flat[:, None], vertices[:, [0, 2]], upright)


def faceted(points: Float64[np.ndarray, "p 3"], polygons: list[list[int]]) -> Surface:
    """A closed body from convex polygons, all counted the same way round."""
    source = np.concatenate([np.array(polygon) for polygon in polygons])
    starts = np.cumsum([0, *(len(polygon) for polygon in polygons[:-1])])
    fans = [
        (start, start + k, start + k + 1)
        for start, polygon in zip(starts, polygons, strict=True)
        for k in range(1, len(polygon) - 1)
    ]
    return outward(_flat(points[source], np.array(fans, np.int32)))


def _flat(vertices: Float64[np.ndarray, "v 3"], triangles: Int32[np.ndarray, "f 3"]) -> Surface:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    each = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], each)
    return surface(vertices, triangles, planar_uv(vertices, normals))


@cache
def _box_plan() -> tuple[Int32[np.ndarray, " v"], Int32[np.ndarray, "f 3"]]:
    """Which of the 24 points (corner, axis) each vertex is, and the triangles."""
    corners = [np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    number = {tuple(corner.tolist()): i for i, corner in enumerate(corners)}
    polygons: list[list[tuple[int, int]]] = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1, 1):
            around = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            face = [_corner({axis: sign, b: p, c: q}) for p, q in around]
            polygons.append([(number[corner], axis) for corner in face])
            strip = [_corner({axis: s, b: p, c: sign}) for s in (-1, 1) for p in (sign,)]
            other = [_corner({axis: s, b: -sign, c: sign}) for s in (-1, 1)]
            for low, high in (strip, other):
                edge = [(number[low], b), (number[high], b), (number[high], c), (number[low], c)]
                polygons.append(edge)
    polygons += [[(i, 0), (i, 1), (i, 2)] for i in range(8)]
    return _outward_plan(polygons, np.array(corners, np.float64))


def _corner(signs: dict[int, int]) -> tuple[int, int, int]:
    return signs[0], signs[1], signs[2]


def _outward_plan(
    polygons: list[list[tuple[int, int]]], corners: Float64[np.ndarray, "8 3"]
) -> tuple[Int32[np.ndarray, " v"], Int32[np.ndarray, "f 3"]]:
    source: list[int] = []
    triangles: list[tuple[int, int, int]] = []
    for polygon in polygons:
        points = np.array([corners[i] * np.where(np.arange(3) == a, 1.0, 0.9) for i, a in polygon])
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        turned = polygon if normal @ points.mean(0) > 0 else polygon[::-1]
        first = len(source)
        source += [3 * i + a for i, a in turned]
        triangles += [(first, first + k, first + k + 1) for k in range(1, len(polygon) - 1)]
    return np.array(source, np.int32), np.array(triangles, np.int32)


def box(size: tuple[float, float, float], bevel: float = 0.0) -> Surface:
    """A box of size (x, y, z) that stands on y = 0; a bevel breaks its edges."""
    half = 0.5 * np.array(size)
    bevel = min(bevel if bevel > 0 else 0.03 * min(size), 0.45 * min(size))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    inset = half - bevel * (1.0 - np.eye(3))
    points = (signs[:, None] * inset[None]).reshape(-1, 3)
    source, triangles = _box_plan()
    return _flat(points[source] - np.array([0.0, half[1], 0.0]), triangles)


def boxes(
    placed: list[tuple[tuple[float, float, float], tuple[float, float, float]]], bevel: float = 0.0
) -> Surface:
    """Boxes of the given sizes, each standing on its point (x, y, z)."""
    return merged(*(box(size, bevel).at(*point) for size, point in placed))


def extruded(outline: Float64[np.ndarray, "n 2"], depth: float, bevel: float) -> Surface:
    """An upright slab: outline in (x, height), counted counter-clockwise, thickness along z."""
    center = outline.mean(0)
    shrunk = center + (outline - center) * (1 - bevel / np.abs(outline - center).max())
    count = len(outline)
    rings = [
        (shrunk, -0.5),
        (outline, -0.5 + bevel / depth),
        (outline, 0.5 - bevel / depth),
        (shrunk, 0.5),
    ]
    points = np.concatenate(
        [np.stack([r[:, 0], -r[:, 1], np.full(count, z * depth)], -1) for r, z in rings]
    )
    after = [(k + 1) % count for k in range(count)]
    sides = [
        [
            ring * count + k,
            ring * count + after[k],
            (ring + 1) * count + after[k],
            (ring + 1) * count + k,
        ]
        for ring in range(3)
        for k in range(count)
    ]
    caps = ear_clipped(outline)
    front = [[k for k in cap[::-1]] for cap in caps]
    back = [[3 * count + k for k in cap] for cap in caps]
    return faceted(points, [*sides, *front, *back])


def ear_clipped(outline: Float64[np.ndarray, "n 2"]) -> list[list[int]]:
    """Triangles of a simple polygon that is counted counter-clockwise."""
    left, triangles = list(range(len(outline))), []
    while len(left) > 3:
        ear = next(i for i in range(len(left)) if _is_ear(outline, left, i))
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    return [*triangles, left]


def _is_ear(outline: Float64[np.ndarray, "n 2"], left: list[int], i: int) -> bool:
    a, b, c = (outline[left[k % len(left)]] for k in (i - 1, i, i + 1))
    if _turn(a, b, c) <= 0:
        return False
    corners = {left[i - 1], left[i], left[(i + 1) % len(left)]}
    others = (outline[k] for k in left if k not in corners)
    return not any(
        _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0 for p in others
    )


def _turn(
    a: Float64[np.ndarray, "2"], b: Float64[np.ndarray, "2"], c: Float64[np.ndarray, "2"]
) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

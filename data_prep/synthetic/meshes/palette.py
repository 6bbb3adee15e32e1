"""Few textures per mesh: materials without an image share one, a cell of colour for each.

Every part of a world is an instance, and a world has at most 254.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from diff4splat.data_prep.synthetic.meshes.obj_parts import IMAGE_SIDE_PX, ObjPart

MOST_IMAGES = 5
CELLS = 8
"""Colours along each side of a palette."""
CONSTANT = 1e-3
"""Repeats per metre of parts whose texture coordinates do not vary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TexturedPart:
    """Triangles and the image on them."""

    vertices: Float32[np.ndarray, "v 3"]
    triangles: Int64[np.ndarray, "f 3"]
    uv: Float32[np.ndarray, "v 2"]
    image: UInt8[np.ndarray, "128 128 3"]
    repeats: float
    """Of the image, per unit of length."""
    gloss: float


def textured_parts(parts: list[ObjPart]) -> list[TexturedPart]:
    """Parts with an image, largest first, then one of all others on a palette."""
    areas = np.array([area(part.vertices, part.triangles) for part in parts])
    order = np.argsort(-areas, kind="stable")
    pictured = [int(k) for k in order if parts[k].image is not None][:MOST_IMAGES]
    plain = [int(k) for k in order if int(k) not in pictured]
    found = [_pictured(parts[k]) for k in pictured]
    if plain:
        found.append(_on_palette([parts[k] for k in plain], areas[plain]))
    return found


def area(vertices: Float32[np.ndarray, "v d"], triangles: Int64[np.ndarray, "f 3"]) -> float:
    """Of all triangles, in two or three dimensions."""
    return float(triangle_areas(vertices, triangles).sum())


def triangle_areas(
    vertices: Float32[np.ndarray, "v d"], triangles: Int64[np.ndarray, "f 3"]
) -> Float64[np.ndarray, " f"]:
    """Of each triangle, in two or three dimensions."""
    a, b, c = (vertices[triangles[:, k]].astype(np.float64) for k in range(3))
    first, second = b - a, c - a
    squared = (first**2).sum(-1) * (second**2).sum(-1) - (first * second).sum(-1) ** 2
    return 0.5 * np.sqrt(squared.clip(0))


def _pictured(part: ObjPart) -> TexturedPart:
    assert part.image is not None
    surface, pictured = area(part.vertices, part.triangles), area(part.uv, part.triangles)
    repeats = float(np.sqrt(pictured / surface)) if surface > 0 else CONSTANT
    return TexturedPart(
        vertices=part.vertices,
        triangles=part.triangles,
        uv=part.uv,
        image=part.image,
        repeats=max(repeats, CONSTANT),
        gloss=part.gloss,
    )


def _on_palette(parts: list[ObjPart], areas: Float64[np.ndarray, " k"]) -> TexturedPart:
    """All parts as one; colours beyond the palette share its last cell."""
    side = IMAGE_SIDE_PX // CELLS
    colors = np.zeros((CELLS * CELLS, 3), np.uint8)
    uvs = []
    for number, part in enumerate(parts):
        cell = min(number, CELLS * CELLS - 1)
        colors[cell] = part.color if number == cell else colors[cell]
        at = (np.array([cell % CELLS, cell // CELLS]) + 0.5) / CELLS
        uvs.append(np.tile(at.astype(np.float32), (len(part.vertices), 1)))
    image = colors.reshape(CELLS, CELLS, 3).repeat(side, 0).repeat(side, 1)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    weights = areas / areas.sum() if areas.sum() > 0 else np.full(len(parts), 1 / len(parts))
    return TexturedPart(
        vertices=np.concatenate([part.vertices for part in parts]),
        triangles=np.concatenate([p.triangles + s for p, s in zip(parts, starts, strict=True)]),
        uv=np.concatenate(uvs),
        image=np.ascontiguousarray(image),
        repeats=CONSTANT,
        gloss=float((weights * [part.gloss for part in parts]).sum()),
    )

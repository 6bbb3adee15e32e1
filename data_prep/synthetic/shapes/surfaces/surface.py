"""Pieces of triangle mesh and how they are put together.

Axes: ``v`` vertices, ``f`` triangles. World axes: x right, y down, z forward; an object's own frame
has its front at +x, its top at −y and its lowest point at y = 0. Triangles are counted so that
(b − a) × (c − a) points out of the body. Sharp edges have their vertices twice, so everything is
shaded smoothly. Texture coordinates are metres along the surface; around closed bodies they run
half way and back, so there is no seam.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int32


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """Triangles with texture coordinates, and the joint that carries each vertex."""

    vertices: Float64[np.ndarray, "v 3"]
    triangles: Int32[np.ndarray, "f 3"]
    uv: Float64[np.ndarray, "v 2"]
    joint: Int32[np.ndarray, " v"]

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Surface":
        """Shifted by (x, y, z)."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def scaled(self, factor: float) -> "Surface":
        """Larger by ``factor``, texture coordinates included."""
        return replace(self, vertices=self.vertices * factor, uv=self.uv * factor)

    def stretched(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> "Surface":
        """Stretched along the axes; texture coordinates stay."""
        return replace(self, vertices=self.vertices * np.array([x, y, z]))

    def turned(self, rotation: Float64[np.ndarray, "3 3"]) -> "Surface":
        """Turned about the origin."""
        return replace(self, vertices=self.vertices @ rotation.T)

    def on_joint(self, number: int) -> "Surface":
        """All vertices carried by one joint."""
        return replace(self, joint=np.full(len(self.vertices), number, np.int32))


def surface(
    vertices: Float64[np.ndarray, "v 3"],
    triangles: Int32[np.ndarray, "f 3"],
    uv: Float64[np.ndarray, "v 2"],
) -> Surface:
    """A piece that hangs on the root joint."""
    joint = np.zeros(len(vertices), np.int32)
    return Surface(vertices=vertices, triangles=triangles, uv=uv, joint=joint)


def merged(*pieces: Surface) -> Surface:
    """All pieces as one; nothing is welded."""
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces[:-1])])
    shifted = [p.triangles + np.int32(s) for p, s in zip(pieces, starts, strict=True)]
    return Surface(
        vertices=np.concatenate([piece.vertices for piece in pieces]),
        triangles=np.concatenate(shifted),
        uv=np.concatenate([piece.uv for piece in pieces]),
        joint=np.concatenate([piece.joint for piece in pieces]),
    )


def signed_volume(piece: Surface) -> float:
    """Cubic metres inside a closed piece; negative when it is inside out."""
    a, b, c = (piece.vertices[piece.triangles[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def outward(piece: Surface) -> Surface:
    """A closed piece, turned inside out if need be."""
    if signed_volume(piece) >= 0:
        return piece
    return replace(piece, triangles=np.ascontiguousarray(piece.triangles[:, ::-1]))


def both_sides(piece: Surface, thickness: float) -> Surface:
    """A sheet and its back, slightly apart along their own normals, for objects seen from both."""
    shift = 0.5 * thickness * vertex_normals(piece.vertices, piece.triangles)
    back = replace(
        piece,
        vertices=piece.vertices - shift,
        triangles=np.ascontiguousarray(piece.triangles[:, ::-1]),
    )
    return merged(replace(piece, vertices=piece.vertices + shift), back)


def vertex_normals(
    vertices: Float64[np.ndarray, "v 3"], triangles: Int32[np.ndarray, "f 3"]
) -> Float64[np.ndarray, "v 3"]:
    """Unit normals, weighted by area."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    each = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, triangles[:, k], each)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def grid_triangles(rows: int, columns: int, *, closed: bool = False) -> Int32[np.ndarray, "f 3"]:
    """Triangles of a rows x columns grid; ``closed`` joins the last column to the first."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - (not closed)), indexing="ij")
    after = (j + 1) % columns
    a, b = i * columns + j, i * columns + after
    c, d = a + columns, b + columns
    both = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 2)
    return both.reshape(-1, 3).astype(np.int32)


def about_x(angle_rad: float) -> Float64[np.ndarray, "3 3"]:
    """Rotation about x."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle_rad: float) -> Float64[np.ndarray, "3 3"]:
    """Rotation about the vertical: the front, +x, turns towards −z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_z(angle_rad: float) -> Float64[np.ndarray, "3 3"]:
    """Rotation about z: x turns towards +y, which is down."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

"""The ground out of doors: flat where objects move, rolling beyond, hills at the horizon.

Heights are metres above y = 0. The mesh is a disc of rings whose spacing grows with distance, so
triangles look equally large from the stage.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.motions.context import rest_positions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import one
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface, grid_triangles, surface
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import plane_waves

_RINGS, _SECTORS = 30, 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Terrain:
    """Heights that rise outside ``flat_m``."""

    flat_m: float
    far_m: float
    hills_m: float
    rng: Rng

    def height(
        self, x: Float64[np.ndarray, "*b"], z: Float64[np.ndarray, "*b"]
    ) -> Float64[np.ndarray, "*b"]:
        """Metres above y = 0."""
        if self.hills_m <= 0:
            return np.zeros_like(x)
        distance = np.hypot(x, z)
        points = np.stack([x, 0 * x, z], -1)
        near = plane_waves(points, self.rng.child("near"), 0.25 / self.flat_m, 2)
        far = plane_waves(points, self.rng.child("far"), 0.5 / self.far_m, 3)
        rise = np.clip((distance - self.flat_m) / (2.0 * self.flat_m), 0.0, 1.0) ** 2
        hill = np.clip((distance - 3.0 * self.flat_m) / (0.7 * self.far_m), 0.0, 1.0) ** 1.5
        return 0.05 * self.flat_m * rise * (near + 0.4) + self.hills_m * hill * (0.75 + 0.55 * far)


def ground(terrain: Terrain, role: str) -> PlacedObject:
    """The ground mesh."""
    inner = 0.2 * terrain.flat_m
    radius = inner * (terrain.far_m / inner) ** np.linspace(0.0, 1.0, _RINGS)
    angle = np.arange(_SECTORS) * (2 * np.pi / _SECTORS)
    x = (radius[:, None] * np.cos(angle)).ravel()
    z = (radius[:, None] * np.sin(angle)).ravel()
    disc = _disc(x, z, terrain)
    shape = one(role, disc)
    return PlacedObject(family="ground", shape=shape, parts=rest_positions(shape))


def _disc(x: Float64[np.ndarray, " n"], z: Float64[np.ndarray, " n"], terrain: Terrain) -> Surface:
    x, z = np.append(x, 0.0), np.append(z, 0.0)
    vertices = np.stack([x, -terrain.height(x, z), z], -1)
    rings = grid_triangles(_RINGS, _SECTORS, closed=True)
    first = np.arange(_SECTORS)
    middle = np.stack([np.full(_SECTORS, _RINGS * _SECTORS), first, (first + 1) % _SECTORS], -1)
    triangles = np.concatenate([rings[:, ::-1], middle[:, ::-1]]).astype(np.int32)
    a, b, c = vertices[triangles[0]]
    if np.cross(b - a, c - a)[1] > 0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return surface(vertices, triangles, np.stack([x, z], -1))

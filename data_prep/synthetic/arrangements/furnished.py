"""Places with meshes of natural size: furnished rooms, and open ground with people and objects.

Large objects stand on the floor, many with their backs to a wall; small ones also lie on others.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.arrangements.backdrops import Backdrop
from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.layout.props import place_static
from diff4splat.data_prep.synthetic.meshes.library import MeshLibrary
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape

LEAST, MOST = 5, 18
ATTEMPTS = 8
HEIGHTS_M = (0.03, 2.8)
SCALES = (0.85, 1.18)
SMALL_M = 0.5
"""Largest extent of objects that may lie on others."""
SUPPORT_M = (0.3, 1.2)
"""Height of the tops that they lie on."""
ON_OTHERS_SHARE, AT_WALL_SHARE = 0.75, 0.6
OPEN_M, GAP_M = 3.5, 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class Furniture:
    """A placed mesh and the box around it."""

    placed: PlacedObject
    low_m: Float64[np.ndarray, "3"]
    high_m: Float64[np.ndarray, "3"]

    @property
    def center_m(self) -> Float64[np.ndarray, "3"]:
        """Of the box."""
        return 0.5 * (self.low_m + self.high_m)

    @property
    def radius_m(self) -> float:
        """Of the sphere around the box."""
        return 0.5 * float(np.linalg.norm(self.high_m - self.low_m))


def furnish(library: MeshLibrary, backdrop: Backdrop, rng: Rng) -> list[Furniture]:
    """Meshes that do not overlap, at natural sizes."""
    placed: list[Furniture] = []
    for number in range(rng.integer(LEAST, MOST)):
        child = rng.child("mesh", number)
        name, shape = _natural(library, child)
        for attempt in range(ATTEMPTS):
            item = _try_place(name, shape, placed, backdrop, child.child("place", attempt))
            if item is not None:
                placed.append(item)
                break
    return placed


def _natural(library: MeshLibrary, rng: Rng) -> tuple[str, Shape]:
    number = library.draw_number(rng.child("which"))
    note = library.notes[number]
    height = min(max(note.height_m * rng.log_uniform(*SCALES), HEIGHTS_M[0]), HEIGHTS_M[1])
    return library.noun(number), library.shape(number).of_height(height)


def _try_place(
    name: str, shape: Shape, others: list[Furniture], backdrop: Backdrop, rng: Rng
) -> Furniture | None:
    """None where it would overlap another one or leave the room."""
    small = float(np.max(shape.bounds[1] - shape.bounds[0])) < SMALL_M
    supports = [one for one in others if SUPPORT_M[0] < -one.low_m[1] < SUPPORT_M[1]]
    if small and supports and rng.bernoulli(ON_OTHERS_SHARE):
        support = rng.choice(supports)
        yaw, y = rng.uniform(-np.pi, np.pi), float(support.low_m[1])
        reach = 0.3 * (support.high_m - support.low_m)
        x, _, z = (support.center_m + reach * rng.uniform_array(-1.0, 1.0, 3)).tolist()
    else:
        y = 0.0
        x, z, yaw = _on_floor(shape, backdrop, rng)
    item = _boxed(place_static(name, shape, x, z, yaw=yaw, y=y))
    inside = backdrop.is_open or all(
        max(-item.low_m[axis], item.high_m[axis]) < half
        for axis, half in zip((0, 2), backdrop.half_m, strict=True)
    )
    fits = item.high_m[1] - item.low_m[1] < backdrop.height_m
    return item if inside and fits and not any(_overlap(item, one) for one in others) else None


def _on_floor(shape: Shape, backdrop: Backdrop, rng: Rng) -> tuple[float, float, float]:
    """X, z and yaw: anywhere, or with the back to one of four walls."""
    if backdrop.is_open or not rng.bernoulli(AT_WALL_SHARE):
        wide = (OPEN_M, OPEN_M) if backdrop.is_open else backdrop.half_m
        x, z = (np.array(wide) * rng.uniform_array(-1.0, 1.0, 2)).tolist()
        return x, z, rng.uniform(-np.pi, np.pi)
    turn = rng.integer(0, 3)
    away = (0, 1, 0, 1)[turn]
    depth = float(shape.bounds[1][0] - shape.bounds[0][0])
    distance = backdrop.half_m[away] - depth / 2 - GAP_M
    along = rng.uniform(-1.0, 1.0) * backdrop.half_m[1 - away]
    x, z = ((-distance, along), (along, distance), (distance, along), (along, -distance))[turn]
    return x, z, turn * np.pi / 2


def _boxed(placed: PlacedObject) -> Furniture:
    points = np.concatenate([part[0] for part in placed.parts])
    return Furniture(placed=placed, low_m=points.min(0), high_m=points.max(0))


def _overlap(one: Furniture, other: Furniture) -> bool:
    return bool(((one.low_m < other.high_m - 1e-6) & (other.low_m < one.high_m - 1e-6)).all())

"""What stands behind the objects: a surface, a corner, a room, or open ground.

Metres, y down. The surface or floor is the plane y = 0, and everything else is above it.
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.layout.ground import Terrain, ground
from diff4splat.data_prep.synthetic.motions.context import rest_positions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import one
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_y

KINDS = {"surface": 0.3, "corner": 0.25, "room": 0.2, "open": 0.25}
"""Relative frequencies."""
SURFACE_ROLES = (
    "floor", "wall", "wood", "plaster", "paving", "lawn", "soil", "rug", "cloth", "sand",
    "painted", "facade", "stone", "metal",
)  # fmt: skip
POSTER_ROLES = ("picture", "picture", "painted", "cloth", "book", "pane")
MOST_POSTERS = 3
THICK_M, LIFT_M = 0.1, 0.004
WIDE_M = 30.0
"""Side of a surface without an end; closer ones end in the view."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Backdrop:
    """Static objects, and the room that cameras have."""

    objects: tuple[PlacedObject, ...]
    half_m: tuple[float, float]
    """Cameras stay within ±x and ±z."""
    height_m: float
    """Cameras stay below it."""
    is_open: bool


def make_backdrop(kind: str, rng: Rng) -> Backdrop:
    """A backdrop of one of ``KINDS``."""
    if kind == "open":
        terrain = Terrain(
            flat_m=rng.uniform(2.0, 4.0), far_m=60.0, hills_m=rng.uniform(0.0, 12.0),
            rng=rng.child("terrain"),
        )  # fmt: skip
        role = rng.choice(("lawn", "soil", "sand", "paving", "asphalt"))
        return Backdrop(
            objects=(ground(terrain, role),), half_m=(9.0, 9.0), height_m=9.0, is_open=True
        )
    half = tuple(rng.uniform_array(1.3, 3.5, 2).tolist())
    panels = [_floor(kind, half, rng.child("floor"))]
    if kind == "room":
        height = rng.uniform(2.0, 3.4)
        panels += [_wall(turn, half, rng.child("wall", turn)) for turn in range(4)]
        if rng.bernoulli(0.5):
            panels.append(_panel(2 * half[0], 2 * half[1], rng.child("ceiling"), lift_m=height))
        return Backdrop(objects=tuple(chain(*panels)), half_m=half, height_m=height, is_open=False)
    if kind == "corner":
        count = rng.integer(1, 2)
        panels += [_wall(turn, half, rng.child("wall", turn)) for turn in range(count)]
    return Backdrop(objects=tuple(chain(*panels)), half_m=half, height_m=6.0, is_open=False)


def _floor(kind: str, half: tuple[float, ...], rng: Rng) -> list[PlacedObject]:
    wide = WIDE_M if kind == "surface" else 2 * max(half) + rng.uniform(0.0, 4.0)
    return _panel(wide, wide, rng)


def _wall(turn: int, half: tuple[float, ...], rng: Rng) -> list[PlacedObject]:
    """A wall at +z, turned by quarters about y."""
    flat = _panel(8.0, 8.0, rng)
    stand = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    away = half[1 - turn % 2]
    place = about_y(turn * np.pi / 2)
    return [_moved(item, place @ stand, place @ np.array([0.0, 0.0, away])) for item in flat]


def _panel(wide_m: float, deep_m: float, rng: Rng, lift_m: float = 0.0) -> list[PlacedObject]:
    """A slab whose upper side is y = 0, or whose lower side is at ``lift_m``, with posters."""
    y = THICK_M if lift_m == 0 else -lift_m
    slab = one(rng.choice(SURFACE_ROLES), box((wide_m, THICK_M, deep_m), 0.002).at(y=y))
    size = rng.uniform(0.5, 2.5)
    panel = PlacedObject(family="panel", shape=slab, parts=rest_positions(slab), size_m=size)
    count = rng.integer(0, MOST_POSTERS) if lift_m == 0 and rng.bernoulli(0.6) else 0
    return [panel, *(_poster(rng.child("poster", number)) for number in range(count))]


def _poster(rng: Rng) -> PlacedObject:
    """A thin sheet on y = 0: its pattern has no depth."""
    wide, deep = rng.uniform_array(0.3, 1.6, 2).tolist()
    x, z = rng.uniform_array(-1.5, 1.5, 2).tolist()
    sheet = box((wide, LIFT_M, deep), 0.001).turned(about_y(rng.uniform(-1.0, 1.0)))
    shape = one(rng.choice(POSTER_ROLES), sheet.at(x, 0.0, z))
    return PlacedObject(family="poster", shape=shape, parts=rest_positions(shape), size_m=wide)


def _moved(
    item: PlacedObject, turn: Float64[np.ndarray, "3 3"], shift: Float64[np.ndarray, "3"]
) -> PlacedObject:
    parts = tuple(part @ turn.T + shift for part in item.parts)
    return PlacedObject(family=item.family, shape=item.shape, parts=parts, size_m=item.size_m)

"""Rooms, table tops and courtyards: floors, walls with skirting, windows, doors, pictures, rugs.

A room has no wall behind the cameras and no ceiling, so that one light from outside reaches it and
every view looks in. The walls keep a distance from all cameras.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.motions.context import PartPositions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, boxes
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_y


@dataclass(frozen=True, slots=True, kw_only=True)
class Walls:
    """Distances of the walls from the origin in the room's own frame, turned by ``yaw``."""

    back: float
    left: float
    right: float
    front: float
    height: float
    yaw: float
    floor_y: float = 0.0

    def to_world(self, points: Float64[np.ndarray, "*b 3"]) -> Float64[np.ndarray, "*b 3"]:
        """From the room's frame, whose back wall is at +z."""
        return points @ about_y(self.yaw).T + np.array([0.0, self.floor_y, 0.0])

    def holds(self, x: float, z: float, radius: float) -> bool:
        """Whether a disc lies between the walls."""
        own = about_y(-self.yaw) @ np.array([x, 0.0, z])
        return bool(
            -self.left + radius < own[0] < self.right - radius
            and -self.front < own[2] < self.back - radius
        )


def walls_around(
    eyes: Float64[np.ndarray, "c 3"], area_radius_m: float, rng: Rng, *, floor_y: float = 0.0
) -> Walls:
    """Walls around the central area and every camera."""
    yaw = rng.uniform(-0.5, 0.5)
    own = eyes @ about_y(-yaw).T
    reach = 0.35 * area_radius_m
    base = max(area_radius_m, 0.7) if floor_y == 0 else 0.9
    left = max(rng.uniform(1.6, 2.6) * base, float(-own[:, 0].min()) + reach)
    right = max(rng.uniform(1.6, 2.6) * base, float(own[:, 0].max()) + reach)
    return Walls(
        back=max(rng.uniform(1.5, 2.6) * base, float(own[:, 2].max()) + reach),
        left=left,
        right=right,
        front=float(-own[:, 2].min()) + 3.0 * area_radius_m,
        height=rng.uniform(2.6, 3.6) + 0.8 * base,
        yaw=yaw,
        floor_y=floor_y,
    )


def room(walls: Walls, rng: Rng, *, floor: str = "floor", wall: str = "wall") -> list[PlacedObject]:
    """Floor, walls and skirting."""
    wide, deep = walls.left + walls.right, walls.back + walls.front
    x, z = 0.5 * (walls.right - walls.left), 0.5 * (walls.back - walls.front)
    thick = 0.12
    sides = boxes(
        [
            ((wide + 2 * thick, walls.height, thick), (x, 0.0, walls.back + thick / 2)),
            ((thick, walls.height, deep), (-walls.left - thick / 2, 0.0, z)),
            ((thick, walls.height, deep), (walls.right + thick / 2, 0.0, z)),
        ],
        0.004,
    )
    high = rng.uniform(0.06, 0.14)
    board = boxes(
        [
            ((wide, high, 0.018), (x, 0.0, walls.back - 0.009)),
            ((0.018, high, deep), (-walls.left + 0.009, 0.0, z)),
            ((0.018, high, deep), (walls.right - 0.009, 0.0, z)),
        ],
        0.004,
    )
    slab = box((wide + 2 * thick, 0.1, deep), 0.002).at(x, 0.1, z)
    return [
        wall_object("floor", one(floor, slab), walls),
        wall_object("wall", one(wall, sides), walls),
        wall_object("skirting", one("plaster", board), walls),
    ]


def wall_object(family: str, shape: Shape, walls: Walls, size_m: float = 1.0) -> PlacedObject:
    """An object in the local frame of the room."""
    parts: PartPositions = tuple(
        walls.to_world(part.surface.vertices)[None] for part in shape.parts
    )
    return PlacedObject(family=family, shape=shape, parts=parts, size_m=size_m)


def decoration(walls: Walls, rng: Rng) -> list[PlacedObject]:
    """Windows, pictures and a door on the back and side walls, where they do not overlap."""
    found = []
    for side in ("back", "left", "right"):
        low, high = _span(walls, side)
        place = low + rng.uniform(0.3, 0.9)
        while place < high - 0.5:
            make = rng.weighted_choice((_picture, _window, _door, None), (2.0, 1.2, 0.6, 1.2))
            width = rng.uniform(0.5, 1.1)
            if make is not None and place + width < high - 0.2:
                shape = make(width, walls, rng)
                turned = _on_wall(shape, walls, side, place + width / 2)
                found.append(wall_object(make.__name__.strip("_"), turned, walls, size_m=width))
            place += width + rng.uniform(0.35, 1.0)
    return found


def _span(walls: Walls, side: str) -> tuple[float, float]:
    return (-walls.left, walls.right) if side == "back" else (-0.2 * walls.front, walls.back)


def _on_wall(shape: Shape, walls: Walls, side: str, along: float) -> Shape:
    """``shape`` is made for the back wall: it hangs at z = 0 and comes out towards −z."""
    if side == "back":
        turn, shift = np.eye(3), (along, 0.0, walls.back)
    elif side == "left":
        turn, shift = about_y(-np.pi / 2), (-walls.left, 0.0, along)
    else:
        turn, shift = about_y(np.pi / 2), (walls.right, 0.0, along)
    return several(**{p.role: p.surface.turned(turn).at(*shift) for p in shape.parts})


def _frame(width: float, height: float, low: float, bar: float, cross: bool):
    mid = ((bar, height, 0.03), (0.0, -low, -0.015))
    rails = [((width, bar, 0.04), (0.0, -low - y, -0.02)) for y in (0.0, height - bar)]
    posts = [((bar, height, 0.04), (s * (width - bar) / 2, -low, -0.02)) for s in (-1, 1)]
    middle = [mid, ((width, bar, 0.03), (0.0, -low - height / 2, -0.015))] if cross else []
    return boxes([*rails, *posts, *middle], 0.004)


def _picture(width: float, walls: Walls, rng: Rng) -> Shape:
    height, low = width * rng.uniform(0.65, 1.35), rng.uniform(0.95, 1.25)
    canvas = box((width - 0.04, height - 0.04, 0.012), 0.002).at(0.0, -low - 0.02, -0.006)
    return several(picture=canvas, wood=_frame(width, height, low, 0.035, False))


def _window(width: float, walls: Walls, rng: Rng) -> Shape:
    height, low = rng.uniform(1.0, 1.4), rng.uniform(0.75, 0.95)
    glass = box((width, height, 0.01), 0.002).at(0.0, -low, -0.006)
    sill = box((width + 0.12, 0.04, 0.14), 0.01).at(0.0, -low + 0.04, -0.07)
    frame = _frame(width, height, low, 0.06, True)
    return several(daylight=glass, plaster=frame, fence=sill)


def _door(width: float, walls: Walls, rng: Rng) -> Shape:
    wide, high = rng.uniform(0.8, 0.95), rng.uniform(2.0, 2.15)
    leaf = box((wide, high, 0.03), 0.006).at(z=-0.015)
    panels = [((0.7 * wide, 0.38 * high, 0.02), (0.0, -y * high, -0.035)) for y in (0.08, 0.54)]
    frame = _frame(wide + 0.16, high + 0.08, 0.0, 0.08, False)
    return several(wood=leaf, crate=boxes(panels, 0.008), plaster=frame)


def rug(area_radius_m: float, walls: Walls, rng: Rng) -> PlacedObject:
    """A rug of 2 mm at the centre, round or rectangular."""
    size = (rng.uniform(1.3, 2.4) * area_radius_m, 0.002, rng.uniform(1.2, 2.0) * area_radius_m)
    sheet = box(size, 0.0008).turned(about_y(rng.uniform(-0.6, 0.6))).at(y=0.002)
    offset = rng.uniform_array(-0.3, 0.3, 2) * area_radius_m
    shape = one("rug", sheet.at(float(offset[0]), -0.002, float(offset[1])))
    return wall_object("rug", shape, walls)


def table_top(area_radius_m: float, rng: Rng) -> PlacedObject:
    """The table under a table-top scene; its top is y = 0."""
    size = (rng.uniform(7.0, 11.0) * area_radius_m, 0.035, rng.uniform(4.6, 6.5) * area_radius_m)
    legs = [
        ((0.06, 0.7, 0.06), (a * (0.5 * size[0] - 0.06), 0.735, b * (0.5 * size[2] - 0.06)))
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    top = boxes([(size, (0.0, 0.035, 0.0)), *legs], 0.006)
    yaw = about_y(rng.uniform(-0.35, 0.35))
    shape = one(rng.choice(("wood", "wood", "floor", "cloth")), top.turned(yaw))
    return PlacedObject(
        family="table", shape=shape, parts=(shape.parts[0].surface.vertices[None],), size_m=0.5
    )

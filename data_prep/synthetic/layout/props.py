"""Static props: families that suit a scene, at natural sizes, at free positions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.layout.floor_plan import FloorPlan, PlacedObject
from diff4splat.data_prep.synthetic.motions.context import PartPositions, rest_positions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.data_prep.synthetic.shapes.shape import Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_y
from diff4splat.data_prep.synthetic.splits import Split


def shape_of_size(
    family: str, wanted_m: float, rng: Rng, limits_m: tuple[float, float] = (0.0, 100.0)
) -> Shape | None:
    """A shape whose largest extent is near ``wanted_m``; None when no natural size comes near."""
    shape = FAMILIES[family].make(rng)
    extent = float(np.max(shape.bounds[1] - shape.bounds[0])) / shape.height
    wanted = wanted_m / extent
    ranges = [(max(a, limits_m[0]), min(b, limits_m[1])) for a, b in FAMILIES[family].heights_m]
    heights = [min(max(wanted, low), high) for low, high in ranges if low <= high]
    if not heights:
        return None
    height = min(heights, key=lambda h: abs(np.log(h / wanted)))
    if not 0.45 < height / wanted < 2.2:
        return None
    return shape.of_height(height)


def place_static(
    family: str, shape: Shape, x: float, z: float, *, yaw: float, y: float = 0.0
) -> PlacedObject:
    """A static object at a position, rotated by ``yaw``."""
    turn = about_y(yaw).T
    at = np.array([x, y, z])
    parts: PartPositions = tuple(part @ turn + at for part in rest_positions(shape))
    return PlacedObject(family=family, shape=shape, parts=parts, size_m=shape.height)


@dataclass(frozen=True, slots=True, kw_only=True)
class PropArea:
    """The area and the families of props."""

    plan: FloorPlan
    area_radius_m: float
    holds: Callable[[float, float, float], bool]
    families: tuple[str, ...]
    split: Split
    view_yaw: float = 0.0


def scatter(area: PropArea, count: int, rng: Rng, budget: int) -> list[PlacedObject]:
    """Up to ``count`` props around the centre, within a budget of triangles."""
    placed_objects: list[PlacedObject] = []
    for number in range(3 * count):
        if len(placed_objects) >= count:
            break
        child = rng.child("prop", number)
        placed = _try_prop(area, child)
        if placed is not None and placed.shape.triangles <= budget:
            budget -= placed.shape.triangles
            placed_objects.append(placed)
    return placed_objects


def _try_prop(area: PropArea, rng: Rng) -> PlacedObject | None:
    family = area.split.draw_family(area.families, rng)
    size = area.area_radius_m * rng.uniform(0.22, 0.6) * rng.choice((0.6, 1.0, 1.0, 1.7))
    shape = shape_of_size(family, size, rng)
    if shape is None:
        return None
    radius = 0.94 * shape.radius
    for _ in range(10):
        angle = rng.uniform(0.0, 2 * np.pi)
        out = area.area_radius_m * rng.uniform(0.25, 2.3)
        x, z = float(out * np.cos(angle)), float(out * np.sin(angle))
        if not (area.holds(x, z, radius) and area.plan.is_free(x, z, radius)):
            continue
        if area.plan.is_clear(x, z, radius, shape.height):
            area.plan.take(x, z, radius)
            return place_static(family, shape, x, z, yaw=rng.uniform(0.0, 2 * np.pi))
    return None


def against_walls(area: PropArea, walls, rng: Rng, count: int) -> list[PlacedObject]:
    """Bookcases, sofas and the like with their backs to the back wall."""
    placed_objects = []
    for number in range(count):
        child = rng.child("wall", number)
        family = child.choice(area.families)
        shape = shape_of_size(family, child.uniform(1.2, 2.0), child)
        if shape is None:
            continue
        depth = float(shape.bounds[1][0] - shape.bounds[0][0]) / 2
        half = float(shape.bounds[1][2] - shape.bounds[0][2]) / 2
        own = np.array(
            [child.uniform(-walls.left + half, walls.right - half), 0.0, walls.back - depth - 0.03]
        )
        x, _, z = (walls.to_world(own)).tolist()
        if area.plan.is_free(x, z, half) and area.plan.is_clear(x, z, half, shape.height):
            area.plan.take(x, z, half)
            placed_objects.append(
                place_static(family, shape, x, z, yaw=walls.yaw + np.pi / 2, y=walls.floor_y)
            )
    return placed_objects


def far_objects(area: PropArea, count: int, rng: Rng, budget: int, height_at) -> list[PlacedObject]:
    """Distant trees and houses, upright on the terrain, with their fronts towards the centre."""
    placed_objects: list[PlacedObject] = []
    for number in range(3 * count):
        if len(placed_objects) >= count:
            break
        child = rng.child("far", number)
        family = child.choice(area.families)
        low, high = FAMILIES[family].heights_m[0]
        shape = FAMILIES[family].make(child).of_height(child.uniform(low, high))
        angle = area.view_yaw + child.uniform(-0.95, 0.95)
        out = area.area_radius_m * 2.4 + shape.radius + child.uniform(0.0, 1.0) ** 1.6 * 22.0
        x, z = float(out * np.sin(angle)), float(out * np.cos(angle))
        if shape.triangles > budget or not area.plan.is_free(x, z, 0.8 * shape.radius):
            continue
        if not area.plan.is_clear(x, z, shape.radius, shape.height):
            continue
        area.plan.take(x, z, 0.8 * shape.radius)
        budget -= shape.triangles
        sunk = -height_at(x, z, 0.6 * shape.radius)
        placed_objects.append(
            place_static(
                family, shape, x, z, yaw=np.pi / 2 + angle + child.uniform(-0.5, 0.5), y=sunk
            )
        )
    return placed_objects

"""Choosing things that suit a place, at natural sizes, and standing them where there is room."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.plan import Placed, Plan
from diff4splat.data_prep.synthetic.motions.act import Posed, resting
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.data_prep.synthetic.shapes.shape import Shape
from diff4splat.data_prep.synthetic.shapes.surface import about_y


def natural_shape(
    family: str, wanted_m: float, draws: Draws, limits_m: tuple[float, float] = (0.0, 100.0)
) -> Shape | None:
    """A shape whose largest extent is near ``wanted_m``; None when no natural size comes near."""
    shape = FAMILIES[family].make(draws)
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


def standing(
    family: str, shape: Shape, x: float, z: float, *, yaw: float, y: float = 0.0
) -> Placed:
    """A thing at rest at its place, turned by ``yaw``."""
    turn = about_y(yaw).T
    at = np.array([x, y, z])
    parts: Posed = tuple(part @ turn + at for part in resting(shape))
    return Placed(family=family, shape=shape, parts=parts, size_m=shape.height)


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """Where props may go."""

    plan: Plan
    stage_m: float
    holds: Callable[[float, float, float], bool]
    families: tuple[str, ...]
    view_yaw: float = 0.0


def scatter(site: Site, count: int, draws: Draws, budget: int) -> list[Placed]:
    """Up to ``count`` things around the stage within a budget of triangles."""
    found: list[Placed] = []
    for number in range(3 * count):
        if len(found) >= count:
            break
        mine = draws.child("prop", number)
        placed = _try_prop(site, mine)
        if placed is not None and placed.shape.triangles <= budget:
            budget -= placed.shape.triangles
            found.append(placed)
    return found


def _try_prop(site: Site, draws: Draws) -> Placed | None:
    family = draws.pick(site.families)
    size = site.stage_m * draws.between(0.22, 0.6) * draws.pick((0.6, 1.0, 1.0, 1.7))
    shape = natural_shape(family, size, draws)
    if shape is None:
        return None
    radius = 0.94 * shape.radius
    for _ in range(10):
        angle = draws.between(0.0, 2 * np.pi)
        out = site.stage_m * draws.between(0.25, 2.3)
        x, z = float(out * np.cos(angle)), float(out * np.sin(angle))
        if not (site.holds(x, z, radius) and site.plan.is_free(x, z, radius)):
            continue
        if site.plan.is_clear(x, z, radius, shape.height):
            site.plan.take(x, z, radius)
            return standing(family, shape, x, z, yaw=draws.between(0.0, 2 * np.pi))
    return None


def against_walls(site: Site, walls, draws: Draws, count: int) -> list[Placed]:
    """Bookcases, sofas and the like with their backs to the back wall."""
    found = []
    for number in range(count):
        mine = draws.child("wall", number)
        family = mine.pick(site.families)
        shape = natural_shape(family, mine.between(1.2, 2.0), mine)
        if shape is None:
            continue
        depth = float(shape.bounds[1][0] - shape.bounds[0][0]) / 2
        half = float(shape.bounds[1][2] - shape.bounds[0][2]) / 2
        own = np.array(
            [mine.between(-walls.left + half, walls.right - half), 0.0, walls.back - depth - 0.03]
        )
        x, _, z = (walls.to_world(own)).tolist()
        if site.plan.is_free(x, z, half) and site.plan.is_clear(x, z, half, shape.height):
            site.plan.take(x, z, half)
            found.append(standing(family, shape, x, z, yaw=walls.yaw + np.pi / 2, y=walls.floor_y))
    return found


def far_things(site: Site, count: int, draws: Draws, budget: int, height_at) -> list[Placed]:
    """Trees and houses behind the stage, upright on the terrain; their fronts face the stage."""
    found: list[Placed] = []
    for number in range(3 * count):
        if len(found) >= count:
            break
        mine = draws.child("far", number)
        family = mine.pick(site.families)
        low, high = FAMILIES[family].heights_m[0]
        shape = FAMILIES[family].make(mine).of_height(mine.between(low, high))
        angle = site.view_yaw + mine.between(-0.95, 0.95)
        out = site.stage_m * 2.4 + shape.radius + mine.between(0.0, 1.0) ** 1.6 * 22.0
        x, z = float(out * np.sin(angle)), float(out * np.cos(angle))
        if shape.triangles > budget or not site.plan.is_free(x, z, 0.8 * shape.radius):
            continue
        if not site.plan.is_clear(x, z, shape.radius, shape.height):
            continue
        site.plan.take(x, z, 0.8 * shape.radius)
        budget -= shape.triangles
        sunk = -height_at(x, z, 0.6 * shape.radius)
        found.append(
            standing(family, shape, x, z, yaw=np.pi / 2 + angle + mine.between(-0.5, 0.5), y=sunk)
        )
    return found

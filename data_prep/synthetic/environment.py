"""The static objects of a scene."""

from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.layout.floor_plan import FloorPlan, PlacedObject
from diff4splat.data_prep.synthetic.layout.ground import Terrain, ground
from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.layout.props import (
    PropArea,
    against_walls,
    far_objects,
    scatter,
)
from diff4splat.data_prep.synthetic.layout.rooms import (
    decoration,
    room,
    rug,
    table_top,
    walls_around,
)
from diff4splat.data_prep.synthetic.object_sampler import ObjectSampler
from diff4splat.data_prep.synthetic.rng import Rng

_BUDGET = 17_000
"""Triangles of all static objects, without the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvironmentContext:
    """Inputs for the static objects of a scene."""

    sampler: ObjectSampler
    area_radius_m: float
    plan: FloorPlan
    rng: Rng

    def prop_area(self, families: tuple[str, ...], holds) -> PropArea:
        """The prop area for these families."""
        return PropArea(
            plan=self.plan,
            area_radius_m=self.area_radius_m,
            holds=holds,
            families=families,
            split=self.sampler.split,
        )


def furnish_environment(context: EnvironmentContext, budget: int = _BUDGET) -> list[PlacedObject]:
    """All static objects."""
    scene = context.sampler.scene
    if scene == "tabletop":
        return _table(context, budget)
    if SCENE_KINDS[scene].is_indoors or scene == "courtyard":
        return _room(context, budget)
    return _open(context, budget)


def _room(context: EnvironmentContext, budget: int) -> list[PlacedObject]:
    rng, kind = context.rng, SCENE_KINDS[context.sampler.scene]
    walls = walls_around(context.plan.eyes, context.area_radius_m, rng.child("walls"))
    is_room = kind.is_indoors
    placed = room(walls, rng.child("room"), floor=kind.ground, wall="wall" if is_room else "facade")
    if is_room:
        placed += decoration(walls, rng.child("decoration"))
        if rng.bernoulli(0.5):
            placed.append(rug(context.area_radius_m, walls, rng.child("rug")))
        families = context.sampler.families_with_tags(frozenset({"wall"}))
        if families:
            prop_area = context.prop_area(families, walls.holds)
            placed += against_walls(prop_area, walls, rng.child("walled"), rng.integer(1, 3))
    return placed + _props(context, walls.holds, budget - _count(placed))


def _table(context: EnvironmentContext, budget: int) -> list[PlacedObject]:
    rng = context.rng
    top = table_top(context.area_radius_m, rng.child("table"))
    walls = walls_around(
        context.plan.eyes, context.area_radius_m, rng.child("walls"), floor_y=0.735
    )
    placed = [top, *room(walls, rng.child("room")), *decoration(walls, rng.child("decoration"))]
    points = top.parts[0][0]
    edge = 0.46 * min(float(np.ptp(points[:, 0])), float(np.ptp(points[:, 2])))

    def holds(x: float, z: float, radius: float) -> bool:
        return float(np.hypot(x, z)) + radius < edge

    return placed + _props(context, holds, budget - _count(placed))


def _open(context: EnvironmentContext, budget: int) -> list[PlacedObject]:
    rng, kind = context.rng, SCENE_KINDS[context.sampler.scene]
    reach = float(np.hypot(context.plan.eyes[:, 0], context.plan.eyes[:, 2]).max())
    far = 14.0 * reach if kind.is_under_water else rng.uniform(70.0, 140.0)
    terrain = Terrain(
        flat_m=1.25 * max(reach, 2.0 * context.area_radius_m),
        far_m=far,
        hills_m=rng.uniform(*kind.hills_m),
        rng=rng.child("terrain"),
    )
    role = rng.choice((kind.ground, kind.ground, "soil")) if kind.ground == "lawn" else kind.ground
    role = rng.choice(("asphalt", "paving")) if kind.ground == "asphalt" else role

    def height_at(x: float, z: float, radius: float) -> float:
        angle = np.arange(8) * (np.pi / 4)
        rim = np.stack([x + radius * np.cos(angle), z + radius * np.sin(angle)])
        return float(terrain.height(*rim).min()) - 0.02 * radius

    placed = [ground(terrain, role)]
    families = context.sampler.families_with_tags(kind.far)
    families = tuple(name for name in families if name in kind.far)
    if families:
        prop_area = context.prop_area(families, _anywhere)
        count = rng.integer(*kind.far_count)
        placed += far_objects(prop_area, count, rng.child("far"), 11_000, height_at)
    return placed + _props(context, _anywhere, budget - _count(placed[1:]))


def _anywhere(x: float, z: float, radius: float) -> bool:
    return True


def _count(objects: list[PlacedObject]) -> int:
    return sum(item.shape.triangles for item in objects)


def _props(context: EnvironmentContext, holds, budget: int) -> list[PlacedObject]:
    """Small props; in a held-out world the first has a family absent from training."""
    rng, sampler = context.rng, context.sampler
    names = sampler.prop_families()
    placed: list[PlacedObject] = []
    new = tuple(name for name in names if name in sampler.split.families.new)
    if new:
        placed = scatter(context.prop_area(new, holds), 1, rng.child("new"), budget)
    chosen = tuple(rng.permuted(names)[: rng.integer(3, 6)])
    count = rng.integer(*SCENE_KINDS[sampler.scene].props)
    prop_area = context.prop_area(chosen, holds)
    return placed + scatter(prop_area, count, rng.child("props"), budget - _count(placed))

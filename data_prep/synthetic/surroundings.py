"""From a scene kind to everything that stands still in it."""

from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.cast import Cast
from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.ground import Terrain, ground
from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.layout.plan import Placed, Plan
from diff4splat.data_prep.synthetic.layout.props import Site, against_walls, far_things, scatter
from diff4splat.data_prep.synthetic.layout.rooms import (
    decoration,
    room,
    rug,
    table_top,
    walls_around,
)

_BUDGET = 17_000
"""Triangles of everything that stands, without the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What is needed to furnish a scene."""

    cast: Cast
    stage_m: float
    plan: Plan
    draws: Draws

    def site(self, families: tuple[str, ...], holds) -> Site:
        """A place for these families."""
        return Site(plan=self.plan, stage_m=self.stage_m, holds=holds, families=families)


def furnish(around: Surroundings, budget: int = _BUDGET) -> list[Placed]:
    """Everything that stands still."""
    scene = around.cast.scene
    if scene == "tabletop":
        return _table(around, budget)
    if SCENE_KINDS[scene].is_indoors or scene == "courtyard":
        return _room(around, budget)
    return _open(around, budget)


def _room(around: Surroundings, budget: int) -> list[Placed]:
    draws, kind = around.draws, SCENE_KINDS[around.cast.scene]
    walls = walls_around(around.plan.eyes, around.stage_m, draws.child("walls"))
    is_room = kind.is_indoors
    found = room(
        walls, draws.child("room"), floor=kind.ground, wall="wall" if is_room else "facade"
    )
    if is_room:
        found += decoration(walls, draws.child("decoration"))
        if draws.chance(0.5):
            found.append(rug(around.stage_m, walls, draws.child("rug")))
        families = around.cast.of_place(frozenset({"wall"}))
        if families:
            site = around.site(families, walls.holds)
            found += against_walls(site, walls, draws.child("walled"), draws.integer(1, 3))
    return found + _props(around, walls.holds, budget - _count(found))


def _table(around: Surroundings, budget: int) -> list[Placed]:
    draws = around.draws
    top = table_top(around.stage_m, draws.child("table"))
    walls = walls_around(around.plan.eyes, around.stage_m, draws.child("walls"), floor_y=0.735)
    found = [top, *room(walls, draws.child("room")), *decoration(walls, draws.child("decoration"))]
    points = top.parts[0][0]
    edge = 0.46 * min(float(np.ptp(points[:, 0])), float(np.ptp(points[:, 2])))

    def holds(x: float, z: float, radius: float) -> bool:
        return float(np.hypot(x, z)) + radius < edge

    return found + _props(around, holds, budget - _count(found))


def _open(around: Surroundings, budget: int) -> list[Placed]:
    draws, kind = around.draws, SCENE_KINDS[around.cast.scene]
    reach = float(np.hypot(around.plan.eyes[:, 0], around.plan.eyes[:, 2]).max())
    far = 14.0 * reach if kind.is_under_water else draws.between(70.0, 140.0)
    terrain = Terrain(
        flat_m=1.25 * max(reach, 2.0 * around.stage_m),
        far_m=far,
        hills_m=draws.between(*kind.hills_m),
        draws=draws.child("terrain"),
    )
    role = draws.pick((kind.ground, kind.ground, "soil")) if kind.ground == "lawn" else kind.ground
    role = draws.pick(("asphalt", "paving")) if kind.ground == "asphalt" else role

    def height_at(x: float, z: float, radius: float) -> float:
        angle = np.arange(8) * (np.pi / 4)
        around_it = np.stack([x + radius * np.cos(angle), z + radius * np.sin(angle)])
        return float(terrain.height(*around_it).min()) - 0.02 * radius

    found = [ground(terrain, role)]
    families = around.cast.of_place(kind.far)
    families = tuple(name for name in families if name in kind.far)
    if families:
        site = around.site(families, _anywhere)
        count = draws.integer(*kind.far_count)
        found += far_things(site, count, draws.child("far"), 11_000, height_at)
    return found + _props(around, _anywhere, budget - _count(found[1:]))


def _anywhere(x: float, z: float, radius: float) -> bool:
    return True


def _count(placed: list[Placed]) -> int:
    return sum(thing.shape.triangles for thing in placed)


def _props(around: Surroundings, holds, budget: int) -> list[Placed]:
    """Small things; in a held-out world the first is of a family that training never shows."""
    draws, cast = around.draws, around.cast
    names = cast.props()
    found: list[Placed] = []
    new = tuple(name for name in names if name in cast.split.families.new)
    if new:
        found = scatter(around.site(new, holds), 1, draws.child("new"), budget)
    chosen = tuple(draws.shuffled(names)[: draws.integer(3, 6)])
    count = draws.integer(*SCENE_KINDS[cast.scene].props)
    site = around.site(chosen, holds)
    return found + scatter(site, count, draws.child("props"), budget - _count(found))

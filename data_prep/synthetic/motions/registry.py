"""All motions, the families that can perform them, and whether they travel."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from diff4splat.data_prep.synthetic.motions import articulated, rigid, soft
from diff4splat.data_prep.synthetic.motions.context import MotionContext, MotionResult
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES, Family


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """One kind of motion."""

    perform: Callable[[MotionContext], MotionResult]
    ability: str
    """Ability that a family needs."""
    travels: bool
    """Whether it travels along a heading, which captions then mention."""
    heights_m: tuple[float, float] = (0.0, 100.0)
    """Plausible heights; small objects bounce too fast to be visible."""

    def suits(self, family: Family) -> bool:
        """Whether the family can perform it at a natural size."""
        low, high = self.heights_m
        return self.ability in family.abilities and any(
            a <= high and b >= low for a, b in family.heights_m
        )


def _motion(
    perform: Callable[[MotionContext], MotionResult],
    ability: str,
    *,
    travels: bool = False,
    heights_m: tuple[float, float] = (0.0, 100.0),
) -> Motion:
    return Motion(perform=perform, ability=ability, travels=travels, heights_m=heights_m)


MOTIONS: dict[str, Motion] = {
    "slides": _motion(rigid.slides, "move", travels=True),
    "rolls": _motion(rigid.rolls, "roll", travels=True),
    "tumbles": _motion(rigid.tumbles, "tumble", travels=True),
    "spins": _motion(rigid.spins, "spin"),
    "bounces": _motion(rigid.bounces, "bounce", travels=True, heights_m=(0.2, 1.2)),
    "drops": _motion(rigid.drops, "drop", heights_m=(0.2, 1.2)),
    "hops": _motion(rigid.hops, "hop", travels=True, heights_m=(0.2, 1.4)),
    "rises": _motion(rigid.rises, "rise"),
    "circles": _motion(rigid.circles, "orbit", heights_m=(0.05, 1.0)),
    "swings": _motion(rigid.swings, "hang", heights_m=(0.1, 0.7)),
    "walks": _motion(articulated.walks, "walk", travels=True),
    "flies": _motion(articulated.flies, "fly", travels=True),
    "swims": _motion(articulated.swims, "swim", travels=True),
    "slithers": _motion(articulated.slithers, "slither", travels=True),
    "crawls": _motion(articulated.crawls, "crawl", travels=True),
    "drives": _motion(articulated.drives, "drive", travels=True),
    "reaches": _motion(articulated.reaches, "arm"),
    "turns_sails": _motion(articulated.turns_sails, "wheel"),
    "flutters": _motion(soft.flutters, "flutter"),
    "squashes": _motion(soft.squashes, "soft"),
    "grows": _motion(soft.grows, "soft"),
    "shrinks": _motion(soft.shrinks, "soft"),
    "twists": _motion(soft.twists, "soft"),
    "bends": _motion(soft.bends, "soft"),
    "wobbles": _motion(soft.wobbles, "soft"),
    "sways": _motion(soft.sways, "sway"),
}


@cache
def families_for(motion: str) -> tuple[str, ...]:
    """Names of the families that can perform it."""
    return tuple(name for name, family in FAMILIES.items() if MOTIONS[motion].suits(family))

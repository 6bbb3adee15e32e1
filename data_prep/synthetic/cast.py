"""Who may appear: the split's lists, narrowed by recipe and scene, with what must be new."""

from dataclasses import dataclass

from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.kinds import OUTSIDERS, SCENE_KINDS
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS, families_for
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.data_prep.synthetic.splits import Split

_GUESTS: dict[str, frozenset[str]] = {
    "room": frozenset({"quadruped", "books"}),
    "meadow": frozenset({"bird", "flag"}),
    "garden": frozenset({"bird", "stool"}),
    "dunes": frozenset(
        {"bird", "ball", "snake", "car", "quadruped", "flag", "torus", "block", "star"}
    ),
    "street": frozenset({"bird", "quadruped"}),
    "courtyard": frozenset({"bird"}),
    "seabed": frozenset({"fish", "torus", "star", "ball", "snake"}),
}
"""Who also moves in a scene without standing around there otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cast:
    """The choice for one world."""

    split: Split
    scene: str

    def props(self) -> tuple[str, ...]:
        """Families that stand around."""
        kind = SCENE_KINDS[self.scene]
        strange = frozenset().union(*(OUTSIDERS.get(tag, frozenset()) for tag in kind.tags))
        return tuple(
            name
            for name in self.split.families.names
            if FAMILIES[name].places & kind.tags or name in strange
        )

    def of_place(self, tags: frozenset[str]) -> tuple[str, ...]:
        """Allowed families among these tags or names."""
        return tuple(
            name
            for name in self.split.families.names
            if name in tags or FAMILIES[name].places & tags
        )

    def pairs(self) -> list[tuple[str, str]]:
        """Every (motion, family) that can be seen moving here."""
        able = {
            *self.props(),
            *(_GUESTS.get(self.scene, frozenset()) & {*self.split.families.names}),
        }
        return [
            (motion, family)
            for motion in self.split.motions.names
            if not self._is_odd(motion)
            for family in sorted(able.intersection(families_for(motion)))
        ]

    def _is_odd(self, motion: str) -> bool:
        kind = SCENE_KINDS[self.scene]
        if kind.is_under_water:
            return motion in ("bounces", "drops", "swings", "hops")
        return motion == "swims"

    def mover(self, draws: Draws, *, is_lead: bool) -> tuple[str, str]:
        """A motion, then a family that can do it; the lead's motion is new where any is."""
        pairs = self.pairs()
        if is_lead and self.split.motions.new:
            pairs = [pair for pair in pairs if pair[0] in self.split.motions.new] or pairs
        names = sorted({motion for motion, _ in pairs})
        weights = [2.0 if MOTIONS[name].travels else 1.0 for name in names]
        motion = draws.weighted(names, weights)
        return motion, draws.pick([family for name, family in pairs if name == motion])

"""Which object families and motions may appear in a scene of a split."""

from dataclasses import dataclass

from diff4splat.data_prep.synthetic.layout.kinds import OUTSIDERS, SCENE_KINDS
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS, families_for
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import COMPOSITE, FAMILIES
from diff4splat.data_prep.synthetic.splits import Split

_VISITORS: dict[str, frozenset[str]] = {
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
"""Families that may move in a scene but are no static props of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectSampler:
    """The allowed families and motions of one world."""

    split: Split
    scene: str

    def prop_families(self) -> tuple[str, ...]:
        """Families of static props."""
        kind = SCENE_KINDS[self.scene]
        extra = frozenset().union(*(OUTSIDERS.get(tag, frozenset()) for tag in kind.tags))
        return tuple(
            name
            for name in self.split.families.names
            if FAMILIES[name].places & kind.tags or name in extra
        )

    def families_with_tags(self, tags: frozenset[str]) -> tuple[str, ...]:
        """Allowed families with one of these tags or names."""
        return tuple(
            name
            for name in self.split.families.names
            if name in tags or FAMILIES[name].places & tags
        )

    def motion_pairs(self) -> list[tuple[str, str]]:
        """Every allowed (motion, family)."""
        families = {
            *self.prop_families(),
            *(_VISITORS.get(self.scene, frozenset()) & {*self.split.families.names}),
        }
        return [
            (motion, family)
            for motion in self.split.motions.names
            if not self._is_unsuitable(motion)
            for family in sorted(families.intersection(families_for(motion)))
        ]

    def _is_unsuitable(self, motion: str) -> bool:
        kind = SCENE_KINDS[self.scene]
        if kind.is_under_water:
            return motion in ("bounces", "drops", "swings", "hops")
        return motion == "swims"

    def sample_moving_object(self, rng: Rng, *, is_lead: bool) -> tuple[str, str]:
        """Sample a motion and a family; the first object prefers motions absent from training."""
        pairs = self.motion_pairs()
        if is_lead and self.split.motions.new:
            pairs = [pair for pair in pairs if pair[0] in self.split.motions.new] or pairs
        names = sorted({motion for motion, _ in pairs})
        weights = [2.0 if MOTIONS[name].travels else 1.0 for name in names]
        motion = rng.weighted_choice(names, weights)
        families = [family for name, family in pairs if name == motion]
        if COMPOSITE in families_for(motion):
            return motion, self.split.draw_family(families, rng)
        return motion, rng.choice(families)

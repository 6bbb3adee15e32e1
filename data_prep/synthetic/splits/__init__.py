"""Which families, textures, motions, palettes and scenes a split may use: data, versioned.

``training`` worlds use the training lists alone. ``held_out`` worlds use both lists, and at least
one family, one texture and, when something moves, one motion that no training world has.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Literal

from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.materials import ROLES
from diff4splat.data_prep.synthetic.meshes.library import MeshLibrary
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS
from diff4splat.data_prep.synthetic.palettes import PALETTES
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import COMPOSITE, FAMILIES, OF_NO_SPLIT, PERSON
from diff4splat.data_prep.synthetic.shapes.shape import Shape
from diff4splat.errors import ConfigError

SplitName = Literal["training", "held_out"]
VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """Allowed names of one kind, and the subset absent from training."""

    names: tuple[str, ...]
    new: frozenset[str]

    def only(self, chosen: tuple[str, ...] | None, what: str) -> "Allowed":
        """Narrowed to what a recipe asks for.

        Raises:
            ConfigError: a name is unknown or belongs to the other split.
        """
        if chosen is None:
            return self
        for name in chosen:
            if name not in self.names:
                raise ConfigError(
                    f"{what}: expected one of {', '.join(self.names)}, got '{name}'; "
                    "choose another name or the other split"
                )
        return Allowed(names=chosen, new=self.new & frozenset(chosen))


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """All allowed names of a split."""

    families: Allowed
    textures: Allowed
    motions: Allowed
    palettes: Allowed
    scenes: Allowed
    composite_share: float = 0.0
    """Share of objects that are random shapes without a name."""
    person_share: float = 0.0
    """Of the others, the share that are people."""
    meshes: MeshLibrary | None = None
    mesh_share: float = 0.0
    """Share of objects of arrangements that come from ``meshes``."""
    furnished_share: float = 0.0
    """Share of arrangements that are furnished with ``meshes``."""

    def draw_family(self, families: Sequence[str], rng: Rng) -> str:
        """One of ``families``, or composites and people with their shares."""
        if rng.child("composite").bernoulli(self.composite_share):
            return COMPOSITE
        if rng.child("person").bernoulli(self.person_share):
            return PERSON
        return rng.choice(families)

    def draw_shape(self, rng: Rng) -> tuple[str, Shape]:
        """A family and a shape of it, or a noun and a mesh with its share."""
        if self.meshes is not None and rng.child("mesh").bernoulli(self.mesh_share):
            number = self.meshes.draw_number(rng.child("shape"))
            return self.meshes.noun(number), self.meshes.shape(number)
        family = self.draw_family(self.families.names, rng)
        return family, FAMILIES[family].make(rng.child("shape"))


def known_names() -> dict[str, frozenset[str]]:
    """All existing names, by list."""
    textures = {option.family for role in ROLES.values() for option in role.options}
    tables = (FAMILIES.keys() - OF_NO_SPLIT, textures, MOTIONS, PALETTES, SCENE_KINDS)
    lists = ("families", "textures", "motions", "palettes", "scenes")
    return {name: frozenset(table) for name, table in zip(lists, tables, strict=True)}


@cache
def load_split(name: SplitName) -> Split:
    """The current split file, checked."""
    file = resources.files("diff4splat.data_prep.synthetic.splits") / f"v{VERSION}.json"
    return parse_split(json.loads(file.read_text(encoding="utf-8")), name)


def parse_split(content: dict[str, Any], name: str) -> Split:
    """A split from the content of its file.

    Raises:
        ConfigError: another version, an unknown name, a name in both lists or in neither.
    """
    if content.get("version") != VERSION:
        raise ConfigError(f"splits: expected version {VERSION}, got {content.get('version')!r}")
    if name not in ("training", "held_out"):
        raise ConfigError(f"split: expected training or held_out, got '{name}'")
    return Split(
        **{key: _allowed(content, key, known, name) for key, known in known_names().items()}
    )


def _allowed(content: dict[str, Any], key: str, known: frozenset[str], name: str) -> Allowed:
    training, held_out = content[key]["training"], content[key]["held_out"]
    both = [*training, *held_out]
    if unknown := set(both) - known:
        raise ConfigError(f"splits.{key}: expected known names, got {', '.join(sorted(unknown))}")
    if missing := known - set(both):
        raise ConfigError(
            f"splits.{key}: expected every name, missing {', '.join(sorted(missing))}"
        )
    if len(both) != len(set(both)):
        raise ConfigError(f"splits.{key}: expected every name once, got one twice")
    if name == "training":
        return Allowed(names=tuple(sorted(training)), new=frozenset())
    return Allowed(names=tuple(sorted(both)), new=frozenset(held_out))

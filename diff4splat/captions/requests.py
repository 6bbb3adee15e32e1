"""Captions that ask for one object of an image by a name that fits no other, or for none."""

from collections.abc import Iterable, Sequence

import torch

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.phrasings import (
    Choices,
    any_object_name,
    noun_name,
    object_name,
    request,
)
from diff4splat.captions.random_draws import draw, draw_number, draw_share
from diff4splat.captions.synonyms import may_be_confused
from diff4splat.captions.vocabulary import DIRECTIONS, NOUNS, UNNAMED

LIKE_COLORS = frozenset(
    frozenset(pair.split())
    for pair in (
        *("red orange", "red pink", "red brown", "red purple", "orange yellow", "orange brown"),
        *("orange beige", "yellow beige", "yellow green", "brown beige", "brown black"),
        *("beige white", "beige pink", "beige grey", "pink purple", "green turquoise"),
        *("turquoise blue", "blue purple", "blue grey", "turquoise grey", "white grey"),
        *("grey black", "brown grey"),
    )
)
"""Colours that one object may be seen in, by its light."""
PLAIN_SHARE = 0.3
"""Share of captions of the form ``the red ball moves to the left``."""


def caption_of_object(
    objects: list[NamedObject], index: int, direction: str, generator: torch.Generator
) -> str | None:
    """A caption that asks the object at ``index`` to move; None if no name fits it alone."""
    if not is_unique(objects, index):
        return None
    named, others = objects[index], objects[:index] + objects[index + 1 :]
    like = any(_may_fit(named.noun, other.noun) for other in others)
    kinds = ["full", "full", "full"] * bool(named.color) + ["noun"] * (not like)
    if named.color and not any(colors_alike(named.color, other.color) for other in others):
        kinds.append("color")
    return _caption(named, draw(kinds, generator), direction, generator)


def caption_of_absent_object(
    objects: list[NamedObject], generator: torch.Generator, nouns: Sequence[str] = NOUNS
) -> str | None:
    """A caption that asks for one of ``nouns`` that no object has, or for another colour of one.

    None if the image has objects of all nouns and no other colour can be asked for.
    """
    objects = [one for one in objects if one.noun != UNNAMED]
    direction = draw(tuple(DIRECTIONS), generator)
    kind = draw(("full", "full", "noun"), generator)
    found = absent_object(
        objects, generator, other_color=bool(draw_number(generator) % 2), nouns=nouns
    )
    if found is None:
        return None
    other_color = any(may_be_confused(found.noun, one.noun) for one in objects)
    return _caption(found, "full" if other_color else kind, direction, generator)


def absent_object(
    objects: list[NamedObject],
    generator: torch.Generator,
    *,
    other_color: bool,
    nouns: Sequence[str] = NOUNS,
) -> NamedObject | None:
    """One of ``nouns`` that no object has, or another colour of one; None if there is neither."""
    objects = [one for one in objects if one.noun != UNNAMED]
    nouns = [n for n in nouns if not any(may_be_confused(n, one.noun) for one in objects)]
    colors = COLOR_NAMES
    if objects and (other_color or not nouns):
        nouns = [draw([one.noun for one in objects], generator)]
        taken = [one.color for one in objects if may_be_confused(nouns[0], one.noun)]
        colors = colors_unlike(taken)
    return NamedObject(draw(colors, generator), draw(nouns, generator)) if colors else None


def plain_caption(named: NamedObject, direction: str) -> str:
    """``the red ball moves to the left``."""
    return f"the {named.color} {named.noun} moves {DIRECTIONS[direction]}"


def is_unique(objects: list[NamedObject], index: int) -> bool:
    """Whether colour and noun of the object at ``index`` fit no other."""
    named, others = objects[index], objects[:index] + objects[index + 1 :]
    like = [other for other in others if _may_fit(named.noun, other.noun)]
    return not any(colors_alike(named.color, other.color) for other in like)


def _may_fit(noun: str, other: str) -> bool:
    """Whether ``noun`` may be said of the other object; "object" may, of any."""
    return noun == UNNAMED or may_be_confused(noun, other)


def _caption(named: NamedObject, kind: str, direction: str, generator: torch.Generator) -> str:
    if draw_share(generator) < PLAIN_SHARE and kind == "full":
        return plain_caption(named, direction)
    choices = Choices(draw_number(generator))
    return request(_name(named, kind, choices), direction, choices)


def _name(named: NamedObject, kind: str, choices: Choices) -> str:
    """Colour and noun, the noun alone, or the colour alone."""
    if kind == "noun":
        return noun_name(named.noun, choices)
    return any_object_name(named.color, choices) if kind == "color" else object_name(named, choices)


def colors_alike(color: str, other: str) -> bool:
    """Whether one object may be called both; one of several colours may be called any."""
    return not (color and other) or color == other or frozenset((color, other)) in LIKE_COLORS


def colors_unlike(taken: Iterable[str]) -> list[str]:
    """Colours that no object of the ``taken`` ones may be called."""
    taken = set(taken)
    return [color for color in COLOR_NAMES if not any(colors_alike(color, one) for one in taken)]

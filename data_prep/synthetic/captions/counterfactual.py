"""Captions that say something else, for testing whether a model listens."""

from dataclasses import replace
from typing import Literal

from diff4splat.data_prep.synthetic.captions.grammar import (
    CaptionFacts,
    Event,
    describe,
    parse_caption,
)
from diff4splat.data_prep.synthetic.captions.vocabulary import OPPOSITE
from diff4splat.errors import InputError

Change = Literal["reverse", "still", "words"]


def rephrase(caption: str, change: Change, variant: int = 0) -> str:
    """``caption`` with every motion the other way, with nothing moving, or only in other words.

    Raises:
        InputError: the caption is not of the grammar, the change is unknown, or there is nothing to
            reverse.
    """
    facts = parse_caption(caption)
    if change == "words":
        return describe(facts, variant)
    if change == "still":
        named = facts.standing or tuple(event.thing for event in facts.events)
        return describe(replace(facts, events=(), standing=named), variant)
    if change != "reverse":
        raise InputError(f"rephrase: expected reverse, still or words, got {change!r}")
    return describe(_reversed(facts), variant)


def _reversed(facts: CaptionFacts) -> CaptionFacts:
    if not any(event.direction for event in facts.events):
        raise InputError("rephrase: expected a motion with a direction to reverse, got none")
    return replace(facts, events=tuple(map(_turned, facts.events)))


def _turned(event: Event) -> Event:
    return replace(event, direction=OPPOSITE.get(event.direction, ""))

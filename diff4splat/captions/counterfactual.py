"""Captions with another content, to test whether a model follows the text."""

from dataclasses import replace
from typing import Literal

from diff4splat.captions.grammar import (
    CaptionFacts,
    Event,
    describe,
    parse_caption,
)
from diff4splat.captions.vocabulary import OPPOSITE
from diff4splat.errors import InputError

Change = Literal["reverse", "still", "words"]


def rephrase(caption: str, change: Change, variant: int = 0) -> str:
    """``caption`` with every motion reversed, with no motion, or with synonyms.

    Raises:
        InputError: the caption is outside the grammar, the change is unknown, or no motion has a
            direction to reverse.
    """
    facts = parse_caption(caption)
    if change == "words":
        return describe(facts, variant)
    if change == "still":
        named = facts.static_objects or tuple(event.subject for event in facts.events)
        return describe(replace(facts, events=(), static_objects=named), variant)
    if change != "reverse":
        raise InputError(f"rephrase: expected reverse, still or words, got {change!r}")
    return describe(_reverse_facts(facts), variant)


def _reverse_facts(facts: CaptionFacts) -> CaptionFacts:
    if not any(event.direction for event in facts.events):
        raise InputError("rephrase: expected a motion with a direction to reverse, got none")
    return replace(facts, events=tuple(map(_reverse_event, facts.events)))


def _reverse_event(event: Event) -> Event:
    return replace(event, direction=OPPOSITE.get(event.direction, ""))

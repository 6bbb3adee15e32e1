"""Paraphrases of captions: synonyms, fewer clauses, or one plain sentence."""

from dataclasses import replace

from diff4splat.captions.grammar import (
    CaptionFacts,
    describe,
    motion_text,
    parse_caption,
)
from diff4splat.captions.phrasings import Choices, object_name, request
from diff4splat.errors import InputError

FREE_BELOW, PLAIN_BELOW, SHORT_BELOW, SYNONYMS_BELOW = 0.25, 0.5, 0.7, 0.87
"""Thresholds of the draw: a free sentence; a plain one; a caption without place and camera;
synonyms; at the last threshold and above, the caption itself."""


def paraphrase(caption: str, draw: float, variant: int) -> str:
    """Another true caption of the same clip.

    ``draw`` in [0, 1) selects the kind of paraphrase, ``variant`` the synonyms. Captions outside
    the grammar are returned unchanged.
    """
    try:
        facts = parse_caption(caption)
    except InputError:
        return caption
    if draw < FREE_BELOW:
        return _free(facts, variant)
    if draw < PLAIN_BELOW:
        return _plain(facts, variant)
    if draw < SHORT_BELOW:
        return describe(replace(facts, place="", camera=()), variant)
    return describe(facts, variant) if draw < SYNONYMS_BELOW else caption


def _free(facts: CaptionFacts, variant: int) -> str:
    """A free sentence about one object that moves to a side; a plain one if none does."""
    events = [event for event in facts.events if event.direction]
    if not events:
        return _plain(facts, variant)
    choices = Choices(variant)
    event = choices.pick(tuple(events))
    return request(object_name(event.subject, choices), event.direction, choices)


def _plain(facts: CaptionFacts, variant: int) -> str:
    """One sentence about one object, or "nothing moves"."""
    if not facts.events:
        return "nothing moves"
    event = facts.events[variant % len(facts.events)]
    plain_event = replace(event, motion="slides") if event.direction else event
    name = f"{event.subject.color} {event.subject.noun}"
    return f"the {name} {motion_text(plain_event, variant // len(facts.events))}"

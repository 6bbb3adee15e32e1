"""The same facts as people would put them: other words, less of them, or a plain sentence."""

from dataclasses import replace

from diff4splat.data_prep.synthetic.captions.grammar import (
    CaptionFacts,
    describe,
    motion_text,
    parse_caption,
)
from diff4splat.errors import InputError

PLAIN, SHORT, REWORDED = 0.4, 0.65, 0.85
"""Below the first draw: a plain sentence; below the second: without place and camera; below the
third: other words; above: as it stands."""


def said_otherwise(caption: str, draw: float, variant: int) -> str:
    """A true caption of the same clip; ``draw`` in [0, 1) chooses how, ``variant`` the words.

    Captions of another grammar stay.
    """
    try:
        facts = parse_caption(caption)
    except InputError:
        return caption
    if draw < PLAIN:
        return _plain(facts, variant)
    if draw < SHORT:
        return describe(replace(facts, place="", camera=()), variant)
    return describe(facts, variant) if draw < REWORDED else caption


def _plain(facts: CaptionFacts, variant: int) -> str:
    """One sentence about one thing, or about stillness."""
    if not facts.events:
        return "nothing moves"
    event = facts.events[variant % len(facts.events)]
    moves = replace(event, motion="slides") if event.direction else event
    thing = f"{event.thing.color} {event.thing.noun}"
    return f"the {thing} {motion_text(moves, variant // len(facts.events))}"

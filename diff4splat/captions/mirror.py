"""Captions of horizontally flipped clips."""

from dataclasses import replace

from diff4splat.captions.grammar import (
    CaptionFacts,
    Event,
    describe,
    parse_caption,
)
from diff4splat.captions.vocabulary import OPPOSITE
from diff4splat.errors import InputError

_SIDES = ("left", "right")
_SIGNED = ("orbit", "arc", "roll")
"""Camera moves whose sign changes in the flipped clip."""


def mirrored_caption(caption: str, variant: int = 0) -> str:
    """The caption of the flipped clip.

    Captions outside the grammar get each ``left`` and ``right`` swapped.
    """
    try:
        facts = parse_caption(caption)
    except InputError:
        return " ".join(_swap_side(word) for word in caption.split(" "))
    return describe(_mirror_facts(facts), variant)


def _mirror_facts(facts: CaptionFacts) -> CaptionFacts:
    return replace(
        facts,
        events=tuple(map(_mirror_event, facts.events)),
        camera=tuple(_mirror_move(*move) for move in facts.camera),
    )


def _mirror_event(event: Event) -> Event:
    sideways = event.direction in _SIDES
    return replace(event, direction=OPPOSITE[event.direction]) if sideways else event


def _mirror_move(name: str, sign: int) -> tuple[str, int]:
    if name in _SIDES:
        return OPPOSITE[name], sign
    return name, -sign if name in _SIGNED else sign


def _swap_side(word: str) -> str:
    plain = word.rstrip(".,;:!?")
    side = plain.removesuffix("s").removesuffix("ward")
    return OPPOSITE[side] + word[len(side) :] if side in _SIDES else word

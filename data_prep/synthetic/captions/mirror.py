"""Captions of a clip with left and right exchanged."""

from dataclasses import replace

from diff4splat.data_prep.synthetic.captions.grammar import (
    CaptionFacts,
    Event,
    describe,
    parse_caption,
)
from diff4splat.data_prep.synthetic.captions.vocabulary import OPPOSITE
from diff4splat.errors import InputError

_SIDES = ("left", "right")
_SIGNED = ("orbit", "arc", "roll")
"""Camera moves that go the other way in a mirror."""


def mirrored_caption(caption: str, variant: int = 0) -> str:
    """What the caption of the mirror image is; words of another kind are exchanged one by one."""
    try:
        facts = parse_caption(caption)
    except InputError:
        return " ".join(_exchanged(word) for word in caption.split(" "))
    return describe(_mirrored(facts), variant)


def _mirrored(facts: CaptionFacts) -> CaptionFacts:
    return replace(
        facts,
        events=tuple(map(_mirrored_event, facts.events)),
        camera=tuple(_mirrored_move(*move) for move in facts.camera),
    )


def _mirrored_event(event: Event) -> Event:
    sideways = event.direction in _SIDES
    return replace(event, direction=OPPOSITE[event.direction]) if sideways else event


def _mirrored_move(name: str, sign: int) -> tuple[str, int]:
    if name in _SIDES:
        return OPPOSITE[name], sign
    return name, -sign if name in _SIGNED else sign


def _exchanged(word: str) -> str:
    plain = word.rstrip(".,;:!?")
    return OPPOSITE[plain] + word[len(plain) :] if plain in _SIDES else word

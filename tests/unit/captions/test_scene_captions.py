"""Captions of given objects: they parse, and say what was asked."""

import torch

from diff4splat.captions.grammar import NamedObject, parse_caption
from diff4splat.captions.requests import absent_object, is_unique
from diff4splat.captions.scene_captions import caption_of_moving, caption_of_static

BALL, BOX, BUSH = (
    NamedObject("red", "ball"),
    NamedObject("blue", "box"),
    NamedObject("green", "bush"),
)


def test_all_that_move_are_the_subjects() -> None:
    generator = torch.Generator().manual_seed(0)
    beside, motions = set(), set()
    for _ in range(100):
        facts = parse_caption(caption_of_moving([BALL, BOX], [BUSH], generator))
        assert [event.subject for event in facts.events] == [BALL, BOX]
        beside |= {event.beside for event in facts.events}
        motions |= {event.motion for event in facts.events}
    assert beside == {None, BUSH} and len(motions) > 20


def test_nothing_moves_around_objects() -> None:
    generator = torch.Generator().manual_seed(0)
    seen = set()
    for _ in range(60):
        facts = parse_caption(caption_of_static([BALL, BOX, BUSH], generator))
        assert not facts.events and set(facts.static_objects) <= {BALL, BOX, BUSH}
        seen.add(len(facts.static_objects))
    assert seen == {0, 1, 2}
    assert not parse_caption(caption_of_static([], generator)).events


def test_unique_names() -> None:
    orange = NamedObject("orange", "ball")
    assert is_unique([BALL, BOX], 0)
    assert not is_unique([BALL, orange], 0)
    assert is_unique([BALL, NamedObject("blue", "ball")], 0)


def test_absent_objects_have_another_noun_or_another_color() -> None:
    generator = torch.Generator().manual_seed(0)
    for _ in range(50):
        other = absent_object([BALL, BOX], generator, other_color=True)
        assert other.noun in ("ball", "box") and other not in (BALL, BOX)
        assert absent_object([BALL, BOX], generator, other_color=False).noun not in ("ball", "box")

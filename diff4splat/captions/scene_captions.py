"""Captions of the grammar about given objects, with motions, place and camera drawn at random.

What moves depends on none of the three, so a network that looks for it sees all of them.
"""

from dataclasses import replace

import torch

from diff4splat.captions.grammar import CaptionFacts, Event, NamedObject, describe
from diff4splat.captions.random_draws import draw, draw_number, draw_share
from diff4splat.captions.vocabulary import CAMERA_MOVES, DIRECTIONS, PLACES, VERBS

PLACE_SHARE, CAMERA_SHARE, BESIDE_SHARE = 0.15, 0.15, 0.25


def caption_of_moving(
    moving: list[NamedObject], others: list[NamedObject], generator: torch.Generator
) -> str:
    """``moving`` move, maybe beside one of ``others``."""
    events = tuple(_event(named, others, generator) for named in moving)
    return _described(CaptionFacts(events=events), generator)


def caption_of_static(objects: list[NamedObject], generator: torch.Generator) -> str:
    """Nothing moves around up to two of ``objects``."""
    count = min(draw_number(generator) % 3, len(objects))
    order = torch.randperm(len(objects), generator=generator)[:count]
    named = tuple(objects[int(index)] for index in order)
    return _described(CaptionFacts(static_objects=named), generator)


def _event(named: NamedObject, others: list[NamedObject], generator: torch.Generator) -> Event:
    beside = None
    if others and draw_share(generator) < BESIDE_SHARE:
        beside = draw(others, generator)
    direction = draw(("", *DIRECTIONS), generator)
    motion = draw(list(VERBS), generator)
    return Event(subject=named, motion=motion, direction=direction, beside=beside)


def _described(facts: CaptionFacts, generator: torch.Generator) -> str:
    if draw_share(generator) < PLACE_SHARE:
        facts = replace(facts, place=draw(list(PLACES), generator))
    if draw_share(generator) < CAMERA_SHARE:
        facts = replace(facts, camera=(draw(list(CAMERA_MOVES), generator),))
    return describe(facts, draw_number(generator))

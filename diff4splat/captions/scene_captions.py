"""Captions of the grammar about given objects, with motions, place and camera drawn at random.

What moves depends on none of the three, so a network that looks for it sees all of them.
"""

import torch

from diff4splat.captions.grammar import CaptionFacts, Event, NamedObject, describe
from diff4splat.captions.vocabulary import CAMERA_MOVES, DIRECTIONS, PLACES, VERBS

PLACE_SHARE, CAMERA_SHARE, BESIDE_SHARE = 0.15, 0.15, 0.25
_LARGEST = 2**31


def caption_of_moving(
    moving: list[NamedObject], others: list[NamedObject], generator: torch.Generator
) -> str:
    """``moving`` move, maybe beside one of ``others``."""
    events = tuple(_event(named, others, generator) for named in moving)
    return _described(CaptionFacts(events=events), generator)


def caption_of_static(objects: list[NamedObject], generator: torch.Generator) -> str:
    """Nothing moves around up to two of ``objects``."""
    count = min(_number(generator) % 3, len(objects))
    order = torch.randperm(len(objects), generator=generator)[:count]
    named = tuple(objects[int(index)] for index in order)
    return _described(CaptionFacts(static_objects=named), generator)


def _event(named: NamedObject, others: list[NamedObject], generator: torch.Generator) -> Event:
    beside = None
    if others and _share(generator) < BESIDE_SHARE:
        beside = others[_number(generator) % len(others)]
    direction = ("", *DIRECTIONS)[_number(generator) % (len(DIRECTIONS) + 1)]
    motion = list(VERBS)[_number(generator) % len(VERBS)]
    return Event(subject=named, motion=motion, direction=direction, beside=beside)


def _described(facts: CaptionFacts, generator: torch.Generator) -> str:
    place, camera = "", ()
    if _share(generator) < PLACE_SHARE:
        place = list(PLACES)[_number(generator) % len(PLACES)]
    if _share(generator) < CAMERA_SHARE:
        camera = (list(CAMERA_MOVES)[_number(generator) % len(CAMERA_MOVES)],)
    facts = CaptionFacts(
        place=place, camera=camera, events=facts.events, static_objects=facts.static_objects
    )
    return describe(facts, _number(generator))


def _share(generator: torch.Generator) -> float:
    return float(torch.rand((), generator=generator))


def _number(generator: torch.Generator) -> int:
    return int(torch.randint(_LARGEST, (), generator=generator))

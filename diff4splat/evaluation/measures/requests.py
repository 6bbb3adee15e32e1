"""Requests in other words: free sentences that no network is trained on, and absent objects.

A sample gives two free sentences, one for each side, and one request for an object that is not in
the image or has another colour. Which ones depends on the identifier of its clip alone.
"""

import zlib

import torch

from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.phrasings import VALIDATION, Choices, request
from diff4splat.captions.requests import caption_of_absent_object
from diff4splat.captions.vocabulary import NOUNS
from diff4splat.data.clip_objects import PRESENT_SHARE, present_objects
from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.measures.objects import MIN_AREA_FRACTION, image_displacement
from diff4splat.evaluation.measures.text import (
    TextConditionedSystem,
    TextSample,
    mean_rightward_flow,
)
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.records import Score, Skip

FREE, ABSENT = "text_free", "text_absent"


def request_entries(
    row: str, target: TextSample, system: TextConditionedSystem, protocol: Protocol
) -> Entries:
    """Free sentences whose side the object follows, and 1 if an absent object moves nothing."""
    return [
        _free(row, target, system, protocol),
        _absent(row, target, system, protocol),
    ]


def _free(
    row: str, target: TextSample, system: TextConditionedSystem, protocol: Protocol
) -> Score | Skip:
    name = " ".join(word for word in (target.note.color, target.note.name) if word)
    number = _number(target)
    right = 0
    for side, sign in (("left", -1), ("right", 1)):
        sentence = request(name, side, Choices(number), VALIDATION)
        scene = system.generate(target.sample, sentence, protocol.seed)
        right += sign * mean_rightward_flow(scene, target) > 0
    return Score(row=row, key=FREE, value=right / 2)


def _absent(
    row: str, target: TextSample, system: TextConditionedSystem, protocol: Protocol
) -> Score | Skip:
    clip, instances = target.sample.clip, target.sample.input_view.instances
    notes = [note for note, _ in present_objects(clip.note, instances[0], PRESENT_SHARE)]
    named = [NamedObject(note.color, note.name) for note in notes if note.name in NOUNS]
    generator = torch.Generator().manual_seed(_number(target))
    sentence = caption_of_absent_object(named, generator)
    if sentence is None:
        return Skip(row=row, key=ABSENT, why="the image shows all objects that captions can name")
    scene = system.generate(target.sample, sentence, protocol.seed)
    moves = image_displacement(scene, target.sample).norm(dim=-1) > protocol.still_px
    return Score(row=row, key=ABSENT, value=float(moves.double().mean() < MIN_AREA_FRACTION))


def _number(target: TextSample) -> int:
    return zlib.crc32(target.sample.clip.note.identifier.encode()) >> 1

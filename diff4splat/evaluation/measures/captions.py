"""Captions with another motion of one object, in the grammar of the caption of the clip."""

from dataclasses import replace

from diff4splat.captions.grammar import (
    Event,
    NamedObject,
    describe,
    parse_caption,
)
from diff4splat.data.clip import Clip, ObjectNote
from diff4splat.errors import InputError
from diff4splat.evaluation.measures.text import RequestedMotion, plain_caption

MOTION = "slides"
"""Motion of objects whose caption has no direction."""


def grammar_caption(clip: Clip, note: ObjectNote, requested: RequestedMotion) -> str:
    """The caption of the clip with one event or none; a plain sentence outside the grammar."""
    try:
        facts = parse_caption(clip.note.caption)
    except InputError:
        return plain_caption(clip, note, requested)
    subject = NamedObject(note.color, note.name)
    if requested == "still":
        return describe(replace(facts, events=(), static_objects=(subject,)))
    events = [event for event in facts.events if event.subject == subject and event.direction]
    motion = events[0].motion if events else MOTION
    event = Event(subject=subject, motion=motion, direction=requested)
    return describe(replace(facts, events=(event,), static_objects=()))

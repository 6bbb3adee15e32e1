"""Captions that ask for another motion of one object, in the grammar of the clip's own caption."""

from dataclasses import replace

from diff4splat.captions.grammar import (
    Event,
    NamedObject,
    describe,
    parse_caption,
)
from diff4splat.data.clip import Clip, ObjectNote
from diff4splat.errors import InputError
from diff4splat.evaluation.text_measures import Wish, plain_caption

MOTION = "slides"
"""Where the object does not go anywhere by itself, it is asked to slide."""


def grammar_caption(clip: Clip, note: ObjectNote, wish: Wish) -> str:
    """The clip's caption with one event, or none; a plain sentence for captions of other kinds."""
    try:
        facts = parse_caption(clip.note.caption)
    except InputError:
        return plain_caption(clip, note, wish)
    thing = NamedObject(note.color, note.name)
    if wish == "still":
        return describe(replace(facts, events=(), static_objects=(thing,)))
    own = [event for event in facts.events if event.subject == thing and event.direction]
    motion = own[0].motion if own else MOTION
    event = Event(subject=thing, motion=motion, direction=wish)
    return describe(replace(facts, events=(event,), static_objects=()))

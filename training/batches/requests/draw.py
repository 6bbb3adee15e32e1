"""Other requests for the same first image: for another object, an absent one, or one event alone.

In a clip mostly one object moves, often the most salient one, so a network can leave the words out.
With these samples only the words say what moves. Axes: ``t`` latent frames, ``h w`` pixels.
"""

from dataclasses import dataclass, replace
from itertools import accumulate

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.events import is_in_place, split_events
from diff4splat.captions.grammar import parse_caption
from diff4splat.captions.requests import (
    caption_of_absent_object,
    caption_of_object,
)
from diff4splat.data.clip import Clip, View
from diff4splat.errors import InputError
from diff4splat.training.batches.requests.displacement import (
    draw_direction,
    draw_motion,
)
from diff4splat.training.batches.requests.present import (
    TRAINING_NOUNS,
    PresentObject,
    named_objects,
)
from diff4splat.training.batches.targets import INPUT_VIEW
from diff4splat.training.recipe.data import DataSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectRequest:
    """A caption and the motion that it asks for."""

    caption: str
    motion: Float[Tensor, "3 t h w"]
    """As ``pixel_motion``."""


def draw_request(
    clip: Clip,
    motion: Float[Tensor, "3 t h w"],
    settings: DataSettings,
    generator: torch.Generator,
) -> ObjectRequest | None:
    """Another request for the clip's first image; None keeps the clip's own.

    ``settings`` has the shares of all kinds. Clips without depth, masks or names of objects keep
    their own, as do those in which no name fits one object alone. ``motion`` is that of the clip.
    """
    view, draw = clip.views[INPUT_VIEW], float(torch.rand((), generator=generator))
    objects = _present_objects(clip, view)
    if not objects:
        return None
    absent, other, single = accumulate(settings.request_shares)
    if draw < absent:
        return _absent_object(objects, motion.shape[1], generator)
    if draw < other:
        return _other_object(objects, view.depth[0].float(), motion.shape[1], generator)
    if draw < single:
        return _single_event(clip.note.caption, objects, motion, generator)
    return None


def _present_objects(clip: Clip, view: View) -> list[PresentObject]:
    """Objects with a noun of captions, by their pixels with depth in the first image."""
    if view.instances is None or view.depth is None:
        return []
    seen = view.depth[0] > 0
    objects = named_objects(clip.note, view.instances[0])
    return [replace(one, mask=one.mask & seen) for one in objects]


def _absent_object(
    objects: list[PresentObject], latent_frames: int, generator: torch.Generator
) -> ObjectRequest | None:
    """Nothing moves, because the caption names no object of the image."""
    caption = caption_of_absent_object([one.named for one in objects], generator, TRAINING_NOUNS)
    if caption is None:
        return None
    motion = torch.zeros(3, latent_frames, *objects[0].mask.shape)
    return ObjectRequest(caption=caption, motion=motion)


def _other_object(
    objects: list[PresentObject],
    depth: Float[Tensor, "h w"],
    latent_frames: int,
    generator: torch.Generator,
) -> ObjectRequest | None:
    """One of the objects moves to one side."""
    numbers = [number for number, one in enumerate(objects) if one.is_asked_for]
    if not numbers:
        return None
    number = numbers[int(torch.randint(len(numbers), (), generator=generator))]
    direction = draw_direction(generator)
    names = [one.named for one in objects]
    caption = caption_of_object(names, number, direction, generator)
    if caption is None:
        return None
    motion = draw_motion(objects[number].mask, depth, latent_frames, direction, generator)
    return ObjectRequest(caption=caption, motion=motion)


def _single_event(
    caption: str,
    objects: list[PresentObject],
    motion: Float[Tensor, "3 t h w"],
    generator: torch.Generator,
) -> ObjectRequest | None:
    """One event of the clip, after which an object is elsewhere, as if it were the only one."""
    travels = [event for event in split_events(caption) if not is_in_place(event)]
    events = [(event, _subject(event, objects)) for event in travels]
    events = [(event, one) for event, one in events if one is not None]
    if not events:
        return None
    event, one = events[int(torch.randint(len(events), (), generator=generator))]
    return ObjectRequest(caption=event, motion=torch.where(one.mask, motion, 0.0))


def _subject(event: str, objects: list[PresentObject]) -> PresentObject | None:
    """The object that moves by the words of ``event``; None where they fit none, or several."""
    try:
        named = [one.subject for one in parse_caption(event).events]
    except InputError:
        # Captions of other data sets are in words of their own.
        return None
    found = [one for one in objects if one.moves and one.named in named]
    return found[0] if len(named) == len(found) == 1 else None

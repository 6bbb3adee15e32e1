"""Many prompts for one image, each with the pixels that it asks to move.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.random_draws import draw, draw_share
from diff4splat.captions.requests import (
    absent_object,
    caption_of_absent_object,
    caption_of_object,
    colors_unlike,
    is_unique,
)
from diff4splat.captions.scene_captions import caption_of_moving, caption_of_static
from diff4splat.captions.unknown_nouns import caption_of_unknown_noun, draw_unknown_noun
from diff4splat.training.batches.requests.displacement import draw_direction
from diff4splat.training.batches.requests.present import PresentObject, absent_nouns

KIND_SHARES = {
    "named": 0.4,
    "moving": 0.1,
    "two": 0.1,
    "unknown": 0.2,
    "absent": 0.15,
    "static": 0.05,
}
"""One named object, one that moves in the clip, two, one whose noun no vocabulary has, one that is
not there, nothing."""
GRAMMAR_SHARE = 0.4
"""Share of captions in the grammar; the others are free or plain sentences."""
GENERIC_SHARE = 0.25
"""Share of requests that call random shapes objects; the others have an unknown noun for them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageRequest:
    """A caption and the pixels that it asks to move."""

    caption: str
    mask: Bool[Tensor, "h w"]


def draw_image_requests(
    objects: list[PresentObject], empty: Bool[Tensor, "h w"], count: int, generator: torch.Generator
) -> list[ImageRequest]:
    """``count`` requests for an image that shows ``objects``; ``empty`` is the mask of none."""
    kinds = list(KIND_SHARES)
    shares = torch.tensor(list(KIND_SHARES.values()))
    drawn = shares.multinomial(count, replacement=True, generator=generator)
    return [_draw(kinds[int(kind)], objects, empty, generator) for kind in drawn]


def _draw(
    kind: str,
    objects: list[PresentObject],
    empty: Bool[Tensor, "h w"],
    generator: torch.Generator,
) -> ImageRequest:
    kind = _possible(kind, objects)
    if kind == "unknown":
        return _unknown_noun(objects, empty, generator)
    if kind in ("named", "moving", "two"):
        objects = _with_nouns(objects, generator)
    chosen = _chosen(kind, objects, generator)
    names = [one.named for one in objects]
    if chosen:
        mask = torch.stack([objects[index].mask for index in chosen]).any(0)
        return ImageRequest(caption=_caption(names, chosen, generator), mask=mask)
    caption = None if kind == "static" else _absent_caption(names, generator)
    return ImageRequest(caption=caption or caption_of_static(names, generator), mask=empty)


def _with_nouns(objects: list[PresentObject], generator: torch.Generator) -> list[PresentObject]:
    """The same unknown noun for all random shapes of an image: what no known noun fits."""
    if all(one.is_named for one in objects) or draw_share(generator) < GENERIC_SHARE:
        return objects
    noun = draw_unknown_noun(generator)
    return [
        one if one.is_named else replace(one, named=replace(one.named, noun=noun))
        for one in objects
    ]


def _possible(kind: str, objects: list[PresentObject]) -> str:
    """Images in which nothing moves, or has one colour, ask for named objects instead."""
    moves = any(one.moves for one in objects)
    colored = any(one.named.color for one in objects)
    able = {"moving": moves, "unknown": moves or colored}.get(kind, True)
    return kind if able or not objects else "named"


def _chosen(kind: str, objects: list[PresentObject], generator: torch.Generator) -> list[int]:
    """Indices of the objects that are asked to move."""
    names = [one.named for one in objects]
    able = [index for index, one in enumerate(objects) if one.is_asked_for]
    if kind == "moving":
        # Names that fit several objects stay in: then the one moves that would.
        able = [index for index in able if objects[index].moves]
    else:
        able = [index for index in able if is_unique(names, index)]
    count = {"named": 1, "moving": 1, "two": 2}.get(kind, 0)
    order = torch.randperm(len(able), generator=generator).tolist()
    return [able[index] for index in order[:count]]


def _unknown_noun(
    objects: list[PresentObject], empty: Bool[Tensor, "h w"], generator: torch.Generator
) -> ImageRequest:
    """Objects of one colour, or of none; without a colour, those that move in the clip.

    Of those, random shapes alone where there are any: the others have names.
    """
    shown = {one.named.color for one in objects}
    named, others = sorted(shown - {""}), colors_unlike(shown)
    without = [[]] if any(one.moves for one in objects) else []
    colors = draw([named, named, named, others or named, *without], generator)
    color = draw(colors, generator) if colors else ""
    asked = [one for one in objects if (one.named.color == color if color else one.moves)]
    asked = [one for one in asked if not one.is_named] or asked
    return ImageRequest(
        caption=caption_of_unknown_noun(color, generator),
        mask=torch.stack([empty, *(one.mask for one in asked)]).any(0),
    )


def _caption(names: list[NamedObject], chosen: list[int], generator: torch.Generator) -> str:
    if len(chosen) == 1 and draw_share(generator) > GRAMMAR_SHARE:
        caption = caption_of_object(names, chosen[0], draw_direction(generator), generator)
        if caption is not None:
            return caption
    others = [name for index, name in enumerate(names) if index not in chosen]
    return caption_of_moving([names[index] for index in chosen], others, generator)


def _absent_caption(names: list[NamedObject], generator: torch.Generator) -> str | None:
    if draw_share(generator) > GRAMMAR_SHARE:
        return caption_of_absent_object(names, generator, absent_nouns(names, generator))
    other_color = draw_share(generator) < 0.5
    nouns = absent_nouns(names, generator)
    absent = absent_object(names, generator, other_color=other_color, nouns=nouns)
    return None if absent is None else caption_of_moving([absent], names, generator)

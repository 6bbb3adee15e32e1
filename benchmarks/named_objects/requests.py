"""Requests for the first image of a clip: two of its objects, and one that is not there.

Either by name, or by colour and a noun that no training shows.

Axes: ``h w`` pixels.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.captions.phrasings import VALIDATION, Choices, request
from diff4splat.captions.random_draws import draw, draw_number
from diff4splat.captions.requests import (
    caption_of_absent_object,
    colors_alike,
    colors_unlike,
    is_unique,
)
from diff4splat.captions.vocabulary import UNSEEN_NOUNS
from diff4splat.data.clip import Clip
from diff4splat.io.pixels import unit_rgb
from diff4splat.training.batches.requests.present import PresentObject, named_objects

Asked: TypeAlias = tuple[str, PresentObject | None]
OBJECTS = 2
"""Asked for in each image by default, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedImage:
    """An image, sentences, and the pixels that each asks to move: none for the last one."""

    rgb: Float[Tensor, "h w 3"]
    requests: tuple[tuple[str, Bool[Tensor, "h w"]], ...]


def asked_image(
    clip: Clip, *, unknown_nouns: bool = False, most_objects: int = OBJECTS
) -> AskedImage:
    """The first image of a clip; equal clips give equal requests."""
    view = clip.views[0]
    number = zlib.crc32(clip.note.identifier.encode()) >> 1
    generator = torch.Generator().manual_seed(number)
    objects = named_objects(clip.note, view.instances[0])
    ask = _by_color if unknown_nouns else _by_name
    requests = [
        (text, torch.zeros(view.instances[0].shape, dtype=torch.bool) if one is None else one.mask)
        for text, one in ask(objects, generator, most_objects)
    ]
    return AskedImage(rgb=unit_rgb(view.rgb[0]), requests=tuple(requests))


def _by_name(
    objects: list[PresentObject], generator: torch.Generator, most: int
) -> Iterator[Asked]:
    names = [one.named for one in objects]
    able = [i for i, one in enumerate(objects) if one.is_asked_for and is_unique(names, i)]
    for index in _some(able, generator, most):
        name = f"{names[index].color} {names[index].noun}".strip()
        yield _sentence(name, generator), objects[index]
    absent = caption_of_absent_object(names, generator)
    if absent is not None:
        yield absent, None


def _by_color(
    objects: list[PresentObject], generator: torch.Generator, most: int
) -> Iterator[Asked]:
    colors = [one.named.color for one in objects]
    able = [
        one
        for one in objects
        if one.is_asked_for and sum(colors_alike(one.named.color, other) for other in colors) == 1
    ]
    for one in _some(able, generator, most):
        yield _sentence(f"{one.named.color} {draw(UNSEEN_NOUNS, generator)}", generator), one
    absent = colors_unlike(colors)
    if absent:
        name = f"{draw(absent, generator)} {draw(UNSEEN_NOUNS, generator)}"
        yield _sentence(name, generator), None


def _some(able: list[Any], generator: torch.Generator, most: int) -> list[Any]:
    order = torch.randperm(len(able), generator=generator)[:most].tolist()
    return [able[place] for place in order]


def _sentence(name: str, generator: torch.Generator) -> str:
    side = draw(("left", "right"), generator)
    return request(name, side, Choices(draw_number(generator)), VALIDATION)

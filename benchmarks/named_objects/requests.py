"""Requests for the first image of a clip: two of its objects by name, and one that is not there.

Axes: ``h w`` pixels.
"""

import zlib
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.captions.phrasings import VALIDATION, Choices, request
from diff4splat.captions.random_draws import draw, draw_number
from diff4splat.captions.requests import caption_of_absent_object, is_unique
from diff4splat.data.clip import Clip
from diff4splat.io.pixels import unit_rgb
from diff4splat.training.batches.requests.present import named_objects

OBJECTS = 2
"""Asked for in each image, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedImage:
    """An image, sentences, and the pixels that each asks to move: none for the last one."""

    rgb: Float[Tensor, "h w 3"]
    requests: tuple[tuple[str, Bool[Tensor, "h w"]], ...]


def asked_image(clip: Clip) -> AskedImage:
    """The first image of a clip; equal clips give equal requests."""
    view = clip.views[0]
    number = zlib.crc32(clip.note.identifier.encode()) >> 1
    generator = torch.Generator().manual_seed(number)
    objects = named_objects(clip.note, view.instances[0])
    names = [one.named for one in objects]
    able = [i for i, one in enumerate(objects) if one.is_asked_for and is_unique(names, i)]
    order = torch.randperm(len(able), generator=generator)[:OBJECTS].tolist()
    requests = []
    for index in (able[place] for place in order):
        side = draw(("left", "right"), generator)
        name = f"{names[index].color} {names[index].noun}"
        drawn = draw_number(generator)
        sentence = request(name, side, Choices(drawn), VALIDATION)
        requests.append((sentence, objects[index].mask))
    absent = caption_of_absent_object(names, generator)
    if absent is not None:
        requests.append((absent, torch.zeros(view.instances[0].shape, dtype=torch.bool)))
    return AskedImage(rgb=unit_rgb(view.rgb[0]), requests=tuple(requests))

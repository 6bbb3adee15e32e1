"""An image with its named objects: a random part of any frame of a clip.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.clip_objects import object_numbers
from diff4splat.errors import InputError
from diff4splat.training.batches.random_images.random_window import draw_window
from diff4splat.training.batches.requests.present import PresentObject, named_objects


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectImage:
    """sRGB pixels, and the objects that they show."""

    image: UInt8[Tensor, "h w 3"]
    objects: list[PresentObject]
    """Those with a noun of captions."""
    numbers: UInt8[Tensor, "h w"]
    """Number of the object that a pixel shows, of any; 0 for all else."""


def random_object_image(
    clip: Clip, size_px: tuple[int, int], generator: torch.Generator
) -> ObjectImage:
    """A part of some frame, mirrored half of the time.

    Raises:
        InputError: the clip has no masks of objects.
    """
    view = clip.views[int(torch.randint(len(clip.views), (), generator=generator))]
    if view.instances is None:
        raise InputError(
            f"clip {clip.note.identifier}: expected masks of objects, got none; "
            "leave the source out"
        )
    frame = int(torch.randint(clip.frames, (), generator=generator))
    window = draw_window(clip.size_px, size_px, generator)
    instances = window.labels(view.instances[frame])
    return ObjectImage(
        image=window.colors(view.rgb[frame]),
        objects=named_objects(clip.note, instances),
        numbers=object_numbers(clip.note, instances),
    )

"""An image with its named objects: a random part of any frame of a clip.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.clip_objects import object_numbers
from diff4splat.errors import InputError
from diff4splat.training.batches.requests.present import PresentObject, named_objects

WHOLE_SHARE, LEAST_PART = 0.5, 0.55
"""Share of images that are shown whole; least side of a part, as a share of the image's."""


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
    window, mirror = _random_window(clip.size_px, generator)
    maps = [view.rgb[frame][window].numpy(), view.instances[frame][window].numpy()]
    if mirror:
        maps = [np.ascontiguousarray(one[:, ::-1]) for one in maps]
    kinds = (_smooth(maps[0], size_px), cv2.INTER_NEAREST)
    rgb, instances = (
        torch.from_numpy(cv2.resize(one, size_px[::-1], interpolation=kind))
        for one, kind in zip(maps, kinds, strict=True)
    )
    return ObjectImage(
        image=rgb,
        objects=named_objects(clip.note, instances),
        numbers=object_numbers(clip.note, instances),
    )


def _random_window(
    size_px: tuple[int, int], generator: torch.Generator
) -> tuple[tuple[slice, slice], bool]:
    """Rows and columns, and whether to mirror them."""
    mirror, whole, share, top, left = torch.rand(5, generator=generator).tolist()
    share = 1.0 if whole < WHOLE_SHARE else LEAST_PART + (1 - LEAST_PART) * share
    height, width = (round(share * side) for side in size_px)
    top, left = round(top * (size_px[0] - height)), round(left * (size_px[1] - width))
    return (slice(top, top + height), slice(left, left + width)), mirror < 0.5


def _smooth(image: np.ndarray, size_px: tuple[int, int]) -> int:
    return cv2.INTER_AREA if image.shape[0] > size_px[0] else cv2.INTER_CUBIC

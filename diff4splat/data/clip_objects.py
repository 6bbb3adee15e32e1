"""Objects of a clip: one or more instances with one name.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, UInt8
from torch import Tensor

from diff4splat.data.clip import ClipMetadata, ObjectNote

PRESENT_SHARE = 5e-4
"""Share of the image from which a name may mean an object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipObject:
    """One object of a clip."""

    note: ObjectNote
    """Of its first part, whose colour captions name."""
    instances: tuple[int, ...]

    def mask(self, instances: UInt8[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
        """Its pixels in an image of ``View.instances``."""
        return torch.isin(instances, instances.new_tensor(self.instances))


def clip_objects(clip: ClipMetadata) -> tuple[ClipObject, ...]:
    """All objects that the clip has notes of, in order of their first parts."""
    objects: dict[tuple[int, int], list[ObjectNote]] = {}
    for note in clip.objects:
        own = (note.object_number, 0 if note.object_number else note.instance)
        objects.setdefault(own, []).append(note)
    return tuple(
        ClipObject(note=parts[0], instances=tuple(part.instance for part in parts))
        for parts in objects.values()
    )


def object_numbers(clip: ClipMetadata, instances: UInt8[Tensor, "h w"]) -> UInt8[Tensor, "h w"]:
    """Number from 1 of the object that a pixel shows, all parts alike; 0 where there is no note."""
    numbers = torch.zeros(256, dtype=torch.uint8)
    for number, one in enumerate(clip_objects(clip), 1):
        numbers[list(one.instances)] = number
    return numbers[instances.long()]


def present_objects(
    clip: ClipMetadata, instances: UInt8[Tensor, "h w"], least_share: float
) -> list[tuple[ObjectNote, Bool[Tensor, "h w"]]]:
    """Objects that fill ``least_share`` of an image or more, with the pixels of all parts."""
    masks = [(one.note, one.mask(instances)) for one in clip_objects(clip)]
    return [(note, mask) for note, mask in masks if fills(mask, least_share)]


def fills(mask: Bool[Tensor, "h w"], least_share: float) -> bool:
    """Whether a mask has ``least_share`` of the image or more."""
    return float(mask.double().mean()) >= least_share

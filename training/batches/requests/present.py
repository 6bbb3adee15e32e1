"""Named objects that a frame of a clip shows.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, UInt8
from torch import Tensor

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.cutout_nouns import ALL_NOUNS, CUTOUT_NOUNS, MESH_NOUNS
from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.image_classes.class_nouns import classes_of_nouns, noun_classes
from diff4splat.captions.random_draws import draw_share
from diff4splat.captions.synonyms import names
from diff4splat.captions.vocabulary import NOUNS, UNNAMED, UNSEEN_NOUNS
from diff4splat.data.clip import ClipMetadata
from diff4splat.data.clip_objects import PRESENT_SHARE, present_objects
from diff4splat.training.losses.object_mask import UNKNOWN_NAME

AREA_SHARES = (0.003, 0.7)
"""Smallest and largest share of the image that an object is asked for with."""
CLASS_NOUN_SHARE = 0.3
"""Of requests for absent nouns: those of ImageNet's classes."""
TRAINING_NOUNS = tuple(noun for noun in NOUNS if noun not in UNSEEN_NOUNS)
"""Nouns that may be asked for where they are absent: one that is only ever asked for so would seem
to be never there."""


def absent_nouns(objects: list[NamedObject], generator: torch.Generator) -> tuple[str, ...]:
    """Nouns to ask for where they are absent: those of cutouts half of the time beside cutouts.

    Some are of ImageNet's classes that no object belongs to.
    """
    if draw_share(generator) < CLASS_NOUN_SHARE:
        return _other_class_nouns(objects)
    shown = {one.noun for one in objects}
    has_meshes = not shown.isdisjoint(MESH_NOUNS)
    if (has_meshes or not shown.isdisjoint(CUTOUT_NOUNS)) and draw_share(generator) < 0.5:
        return (*CUTOUT_NOUNS, *MESH_NOUNS) if has_meshes else CUTOUT_NOUNS
    return TRAINING_NOUNS


def _other_class_nouns(objects: list[NamedObject]) -> tuple[str, ...]:
    shown = {number for one in objects for name in names(one.noun) for number in noun_classes(name)}
    return tuple(noun for noun, some in classes_of_nouns().items() if shown.isdisjoint(some))


@dataclass(frozen=True, slots=True, kw_only=True)
class PresentObject:
    """An object with a noun of captions."""

    named: NamedObject
    mask: Bool[Tensor, "h w"]
    moves: bool
    """In the clip."""

    @property
    def is_named(self) -> bool:
        """Whether a noun fits it: none does a random shape."""
        return self.named.noun != UNNAMED

    @property
    def is_asked_for(self) -> bool:
        """Whether it is neither too small nor most of the image."""
        least, most = (share * self.mask.numel() for share in AREA_SHARES)
        return least <= int(self.mask.sum()) <= most


def named_objects(clip: ClipMetadata, instances: UInt8[Tensor, "h w"]) -> list[PresentObject]:
    """Objects with a noun of captions or cutouts, and random shapes, in a ``View.instances``."""
    return [
        PresentObject(named=NamedObject(note.color, note.name), mask=mask, moves=bool(note.motion))
        for note, mask in present_objects(clip, instances, PRESENT_SHARE)
        if note.name in (*ALL_NOUNS, UNNAMED)
    ]


def name_maps(
    objects: list[PresentObject], empty: Bool[Tensor, "h w"]
) -> tuple[UInt8[Tensor, "h w"], UInt8[Tensor, "h w"]]:
    """Noun and colour of every pixel, as ``RequestBatch`` has them; ``empty`` masks nothing."""
    nouns, colors = (torch.zeros(empty.shape, dtype=torch.uint8) for _ in range(2))
    for one in objects:
        nouns[one.mask] = _number(one.named.noun, NOUNS)
        colors[one.mask] = _number(one.named.color, COLOR_NAMES)
    return nouns, colors


def _number(name: str, names: tuple[str, ...]) -> int:
    return 1 + names.index(name) if name in names else UNKNOWN_NAME

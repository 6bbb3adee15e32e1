"""Captions and metadata of a world, from measured facts."""

import numpy as np

from diff4splat.captions.colors import color_name
from diff4splat.captions.grammar import (
    CaptionFacts,
    Event,
    NamedObject,
    describe,
    motion_text,
)
from diff4splat.data.clip import ClipMetadata, ObjectNote
from diff4splat.data_prep.synthetic.actors import camera_direction
from diff4splat.data_prep.synthetic.assembly import AssembledObject
from diff4splat.data_prep.synthetic.materials import dominant_color, named_color
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.geometry.camera import Camera, project
from diff4splat.paths.language import parse_path

SOURCE = "diff4splat procedural worlds 1"
LICENSE = "CC0-1.0"


def caption_facts(
    scene: str, assembled: tuple[AssembledObject, ...], camera: Camera, path: str, rng: Rng
) -> CaptionFacts:
    """Moving objects with their directions, central static objects, and the camera motion."""
    moving = [one for one in assembled if one.placed.motion]
    props = [one for one in assembled if not one.placed.motion and one.placed.family in FAMILIES]
    seen = [one for one in props if _is_visible(one, camera)]
    events = tuple(_event(one, seen, camera, rng) for one in moving)
    nearest = sorted(seen, key=lambda one: float(np.linalg.norm(_center(one))))
    standing = () if events else tuple(map(_thing, nearest[: rng.integer(1, 2)]))
    return CaptionFacts(
        place=scene if rng.bernoulli(0.7) else "",
        events=events,
        static_objects=standing,
        camera=tuple((s.name, int(np.sign(s.amplitude))) for s in parse_path(path)),
    )


def _thing(one: AssembledObject) -> NamedObject:
    return NamedObject(
        color_name(dominant_color(one.textures[0])), FAMILIES[one.placed.family].noun
    )


def _event(one: AssembledObject, props: list[AssembledObject], camera: Camera, rng: Rng) -> Event:
    travels = MOTIONS[one.placed.motion].travels
    direction = camera_direction(one.placed.parts, camera) if travels else ""
    beside = None
    if props and rng.bernoulli(0.4):
        near = min(props, key=lambda other: float(np.linalg.norm(_center(other) - _center(one))))
        beside = _thing(near)
    return Event(subject=_thing(one), motion=one.placed.motion, direction=direction, beside=beside)


def _center(one: AssembledObject) -> np.ndarray:
    """Centre at the first frame."""
    points = np.concatenate([part[0] for part in one.placed.parts])
    return 0.5 * (points.min(0) + points.max(0))


def _is_visible(one: AssembledObject, camera: Camera) -> bool:
    """Whether the centre is inside the first image of the input view."""
    pixels, z = project(camera[0], camera.focal_px.new_tensor(_center(one))[None])
    height, width = camera.size_px
    x, y = pixels[0].tolist()
    return bool(z[0] > 0) and 0 < x < width and 0 < y < height


def clip_metadata(
    facts: CaptionFacts,
    assembled: tuple[AssembledObject, ...],
    identifier: str,
    variant: int,
    licenses: tuple[str, ...] = (LICENSE,),
) -> ClipMetadata:
    """Metadata of a clip: caption, and one note per instance."""
    events = iter(facts.events)
    objects: list[ObjectNote] = []
    for number, one in enumerate(assembled, 1):
        words = motion_text(next(events)) if one.placed.motion else ""
        family = one.placed.family
        name = FAMILIES[family].noun if family in FAMILIES else family
        for instance, texture in zip(one.instances, one.textures, strict=True):
            color = named_color(texture)
            objects.append(
                ObjectNote(
                    instance=instance, name=name, color=color, motion=words, object_number=number
                )
            )
    return ClipMetadata(
        identifier=identifier,
        source=SOURCE,
        license=" AND ".join(licenses),
        caption=describe(facts, variant),
        metric="exact",
        is_static=not facts.events,
        objects=tuple(objects),
    )

"""What is true of a world, in words: facts from its numbers, then a caption and object notes."""

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
from diff4splat.data_prep.synthetic.action import direction_seen
from diff4splat.data_prep.synthetic.assembly import Named
from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.materials import dominant_color
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.geometry.camera import Camera, project
from diff4splat.paths.language import parse_path

SOURCE = "diff4splat procedural worlds 1"
LICENSE = "CC0-1.0"


def facts_of(
    scene: str, named: tuple[Named, ...], camera: Camera, path: str, draws: Draws
) -> CaptionFacts:
    """Who moves where, what stands near, and what the input camera does."""
    moving = [one for one in named if one.placed.motion]
    props = [one for one in named if not one.placed.motion and one.placed.family in FAMILIES]
    seen = [one for one in props if _is_seen(one, camera)]
    events = tuple(_event(one, seen, camera, draws) for one in moving)
    nearest = sorted(seen, key=lambda one: float(np.linalg.norm(_middle(one))))
    standing = () if events else tuple(map(_thing, nearest[: draws.integer(1, 2)]))
    return CaptionFacts(
        place=scene if draws.chance(0.7) else "",
        events=events,
        static_objects=standing,
        camera=tuple((s.name, int(np.sign(s.amplitude))) for s in parse_path(path)),
    )


def _thing(one: Named) -> NamedObject:
    return NamedObject(
        color_name(dominant_color(one.textures[0])), FAMILIES[one.placed.family].noun
    )


def _event(one: Named, props: list[Named], camera: Camera, draws: Draws) -> Event:
    travels = MOTIONS[one.placed.motion].travels
    direction = direction_seen(one.placed.parts, camera) if travels else ""
    beside = None
    if props and draws.chance(0.4):
        near = min(props, key=lambda other: float(np.linalg.norm(_middle(other) - _middle(one))))
        beside = _thing(near)
    return Event(subject=_thing(one), motion=one.placed.motion, direction=direction, beside=beside)


def _middle(one: Named) -> np.ndarray:
    """At the first frame."""
    points = np.concatenate([part[0] for part in one.placed.parts])
    return 0.5 * (points.min(0) + points.max(0))


def _is_seen(one: Named, camera: Camera) -> bool:
    """Its middle is in the first picture of the input view."""
    pixels, z = project(camera[0], camera.focal_px.new_tensor(_middle(one))[None])
    height, width = camera.size_px
    x, y = pixels[0].tolist()
    return bool(z[0] > 0) and 0 < x < width and 0 < y < height


def note_of(
    facts: CaptionFacts, named: tuple[Named, ...], identifier: str, variant: int
) -> ClipMetadata:
    """The note of a clip: caption, and one object note per instance."""
    events = iter(facts.events)
    objects: list[ObjectNote] = []
    for one in named:
        words = motion_text(next(events)) if one.placed.motion else ""
        family = one.placed.family
        name = FAMILIES[family].noun if family in FAMILIES else family
        for instance, texture in zip(one.instances, one.textures, strict=True):
            color = color_name(dominant_color(texture))
            objects.append(ObjectNote(instance=instance, name=name, color=color, motion=words))
    return ClipMetadata(
        identifier=identifier,
        source=SOURCE,
        license=LICENSE,
        caption=describe(facts, variant),
        metric="exact",
        is_static=not facts.events,
        objects=tuple(objects),
    )

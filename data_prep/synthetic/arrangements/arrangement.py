"""``make_arrangement(recipe, index)``: a static world of objects before a backdrop.

In the worlds of ``worlds.py`` there is ground below and sky above, and a network that only learns
the image row does well. Here every view is from another side, and nothing is below.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diff4splat.captions.grammar import CaptionFacts
from diff4splat.data_prep.synthetic.arrangements.backdrops import KINDS, Backdrop, make_backdrop
from diff4splat.data_prep.synthetic.arrangements.cameras import any_view
from diff4splat.data_prep.synthetic.arrangements.furnished import Furniture, furnish
from diff4splat.data_prep.synthetic.arrangements.handheld_cameras import handheld_view
from diff4splat.data_prep.synthetic.arrangements.objects import Arranged, arrange
from diff4splat.data_prep.synthetic.assembly import WorldContent, assemble
from diff4splat.data_prep.synthetic.cameras import LensSpec, ViewSpec, camera_batch
from diff4splat.data_prep.synthetic.captioning import LICENSE, clip_metadata
from diff4splat.data_prep.synthetic.lights import sample_any_lighting
from diff4splat.data_prep.synthetic.quantise import POSE_BITS, quantise
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.splits import Split
from diff4splat.data_prep.synthetic.world import Light, World

PORTRAIT_SHARE = 0.4
HIGH_SHARE = 0.6
"""Of arrangements without a room, which would be too low."""
PLACES = {"room": 0.6, "corner": 0.15, "open": 0.25}
"""Relative frequencies of furnished places."""
LEAST_LIGHT_DEG = 15.0
FOV_DEG = 50.0
"""Every view has its own."""


def try_arrangement(
    split: Split, lens: LensSpec, views: int, rng: Rng, identifier: str
) -> World | None:
    """A world with ``views`` static cameras; None where a camera found no free place."""
    if rng.child("furnished").bernoulli(split.furnished_share):
        return _try_furnished(split, lens, views, rng, identifier)
    kind = rng.weighted_choice(list(KINDS), list(KINDS.values()))
    is_portrait = rng.bernoulli(PORTRAIT_SHARE)
    backdrop = make_backdrop(kind, rng.child("backdrop"))
    is_high = kind != "room" and rng.child("high").bernoulli(HIGH_SHARE)
    objects = arrange(split, rng.child("objects"), is_portrait=is_portrait, is_high=is_high)
    specs = [
        any_view(objects, backdrop, rng.child("view", number), is_portrait=is_portrait)
        for number in range(views)
    ]
    return _world(_content(objects, backdrop, split, rng), specs, lens, rng, identifier)


def _try_furnished(
    split: Split, lens: LensSpec, views: int, rng: Rng, identifier: str
) -> World | None:
    """A room or open ground with meshes of natural size; None where a camera found no place."""
    assert split.meshes is not None
    kind = rng.weighted_choice(list(PLACES), list(PLACES.values()))
    backdrop = make_backdrop(kind, rng.child("backdrop"))
    objects = furnish(split.meshes, backdrop, rng.child("furniture"))
    if not objects:
        return None
    specs = [handheld_view(objects, backdrop, rng.child("view", n)) for n in range(views)]
    made = _world(_content(objects, backdrop, split, rng), specs, lens, rng, identifier)
    if made is None or kind != "room":
        return made
    # Without haze and clouds, walls hand on the light of a lamp: see ``lighting_of``.
    return replace(made, sky=replace(made.sky, haze_per_m=0.0, clouds=0.0))


def _content(
    objects: Sequence[Arranged | Furniture], backdrop: Backdrop, split: Split, rng: Rng
) -> WorldContent:
    static = (*backdrop.objects, *(item.placed for item in objects))
    return WorldContent(moving=(), static=static, split=split, rng=rng.child("looks"))


def _world(
    content: WorldContent, specs: list[ViewSpec | None], lens: LensSpec, rng: Rng, identifier: str
) -> World | None:
    """None where a view is missing."""
    views = [camera_batch(spec, lens, 0.0) for spec in specs if spec is not None]
    if len(views) < len(specs):
        return None
    objects, assembled = assemble(content)
    light, sky = sample_any_lighting(rng)
    facts = CaptionFacts(place="", events=(), static_objects=(), camera=())
    return World(
        note=clip_metadata(facts, assembled, identifier, 0, _licenses(content.split)),
        times_s=quantise(np.arange(lens.frames) / lens.fps, POSE_BITS),
        objects=objects,
        light=_from_anywhere(light, rng.child("sun")),
        sky=sky,
        views=tuple(views),
    )


def _licenses(split: Split) -> tuple[str, ...]:
    """Of worlds, and of the meshes in them."""
    return (LICENSE,) if split.meshes is None else split.meshes.licenses


def _from_anywhere(light: Light, rng: Rng) -> Light:
    """The same light from any direction above the surface."""
    lowest = math.sin(math.radians(LEAST_LIGHT_DEG))
    up, azimuth = rng.uniform(lowest, 1.0), rng.uniform(-np.pi, np.pi)
    level = math.sqrt(1 - up * up)
    toward = np.array([level * math.sin(azimuth), -up, level * math.cos(azimuth)])
    return replace(light, toward=quantise(toward, POSE_BITS))

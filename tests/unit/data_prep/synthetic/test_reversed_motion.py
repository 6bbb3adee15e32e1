"""Things that go against what their first image suggests, and things that stand all the same."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.captions.grammar import parse_caption
from diff4splat.captions.vocabulary import OPPOSITE
from diff4splat.data_prep.synthetic.actors import (
    REVERSED_SHARES,
    camera_direction,
    displacement,
    freeze,
    reversed_motion,
)
from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.layout.props import shape_of_size
from diff4splat.data_prep.synthetic.motions.context import PartPositions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.world import World, WorldObject
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError

PLAIN = WorldRecipe(still_share=0.0, frames=5, views=1, size_px=(48, 64))
ALONE, SEVERAL, STAYING = (7, 11), 4, 0
"""Worlds in which one thing travels, two do, and nothing does."""


@cache
def made(index: int, against: float = 0.0, stands: float = 0.0) -> World:
    return make_world(replace(PLAIN, against_share=against, frozen_share=stands), index)


def moving(world: World) -> list[WorldObject]:
    return [thing for thing in world.objects if len(thing.positions) > 1]


def ways(world: World) -> list[str]:
    return [event.direction for event in parse_caption(world.note.caption).events]


def same(one: World, other: World) -> bool:
    pairs = zip(one.objects, other.objects, strict=True)
    return one.note == other.note and all(
        a.positions.tobytes() == b.positions.tobytes() for a, b in pairs
    )


def random_parts(seed: int) -> PartPositions:
    numbers = np.random.default_rng(seed)
    return tuple(numbers.normal(size=(4, count, 3)) for count in (3, 5))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), share=st.floats(0.1, 1.0))
def test_turned_back_goes_so_much_of_the_way_in_the_other_direction(
    seed: int, share: float
) -> None:
    parts = random_parts(seed)
    before, after = displacement(parts), displacement(reversed_motion(parts, share))
    np.testing.assert_allclose(after[[0, 2]], -share * before[[0, 2]], atol=1e-12)
    np.testing.assert_allclose(after[1], before[1], atol=1e-12)


def test_turned_back_keeps_the_first_frame_height_and_posture() -> None:
    parts = random_parts(0)
    turned = reversed_motion(parts, 0.7)
    for part, other in zip(parts, turned, strict=True):
        np.testing.assert_array_equal(other[0], part[0])
        np.testing.assert_array_equal(other[..., 1], part[..., 1])
    # Everything is shifted alike, from frame to frame.
    shift = np.concatenate([b - a for a, b in zip(parts, turned, strict=True)], 1)
    np.testing.assert_allclose(shift, np.broadcast_to(shift[:, :1], shift.shape), atol=1e-12)


@pytest.mark.parametrize("index", ALONE)
def test_the_first_frame_is_the_same_and_the_way_the_opposite(index: int) -> None:
    plain, turned = made(index), made(index, against=1.0)
    assert ways(plain)[0] and ways(turned) == [OPPOSITE[ways(plain)[0]]]
    camera = plain.views[0]
    assert torch.equal(camera.world_from_camera, turned.views[0].world_from_camera)
    for one, other in zip(moving(plain), moving(turned), strict=True):
        np.testing.assert_array_equal(one.positions[0], other.positions[0])
        np.testing.assert_array_equal(one.positions[..., 1], other.positions[..., 1])
        seen = [camera_direction((thing.positions,), camera) for thing in (one, other)]
        assert seen[1] == OPPOSITE[seen[0]]
        size = [np.linalg.norm(displacement((x.positions,))[[0, 2]]) for x in (one, other)]
        assert min(abs(size[1] / size[0] - share) for share in REVERSED_SHARES) < 1e-2


def test_every_travelling_thing_is_turned() -> None:
    before, after = ways(made(SEVERAL)), ways(made(SEVERAL, against=1.0))
    assert len(before) == 2 and after == [OPPOSITE[way] for way in before]


def test_what_does_not_travel_is_not_turned() -> None:
    assert not any(ways(made(STAYING)))
    assert same(made(STAYING), made(STAYING, against=1.0))


def test_a_share_turns_some_things_and_not_others() -> None:
    turned = {index: ways(made(index, against=0.5)) != ways(made(index)) for index in ALONE}
    assert turned == {7: False, 11: True}


def test_a_share_freezes_some_worlds_and_leaves_the_others_as_they_are() -> None:
    assert not moving(made(SEVERAL, stands=0.5))
    assert same(made(7, stands=0.5), made(7))


def test_shares_change_no_camera_and_frozen_worlds_have_the_same_scenery() -> None:
    plain, turned, stands = made(7), made(7, against=1.0), made(7, stands=1.0)
    for other in (turned, stands):
        assert torch.equal(other.views[0].world_from_camera, plain.views[0].world_from_camera)
    still = {thing.positions.tobytes() for thing in plain.objects if len(thing.positions) == 1}
    assert still and still <= {thing.positions.tobytes() for thing in stands.objects}


def test_still_worlds_know_no_shares() -> None:
    still = WorldRecipe(still_share=1.0, frames=5, views=1, size_px=(48, 64))
    shared = replace(still, against_share=1.0, frozen_share=1.0)
    assert same(make_world(still, 0), make_world(shared, 0))


@pytest.mark.parametrize("index", [STAYING, SEVERAL, 7])
def test_in_frozen_worlds_nothing_moves_and_the_caption_says_so(index: int) -> None:
    plain, world = made(index), made(index, stands=1.0)
    assert moving(plain) and not moving(world) and world.note.is_static
    assert not any(note.motion for note in world.note.objects)
    facts = parse_caption(world.note.caption)
    assert not facts.events and "nothing moves" in world.note.caption
    told = {event.subject for event in parse_caption(plain.note.caption).events}
    assert set(facts.static_objects) & told


def test_frozen_things_stand_as_the_first_frame_shows_them() -> None:
    wanted = sorted(thing.positions[0].tobytes() for thing in moving(made(SEVERAL)))
    found = {thing.positions[0].tobytes() for thing in made(SEVERAL, stands=1.0).objects}
    assert len(wanted) >= 2 and found.issuperset(wanted)


def test_frozen_keeps_what_a_thing_is() -> None:
    parts, shape = random_parts(0), shape_of_size("ball", 1.0, Rng("ball"), (0.1, 5.0))
    thing = PlacedObject(family="ball", shape=shape, parts=parts, motion="rolls", size_m=1.0)
    stands = freeze(thing)
    assert stands.motion == "" and stands.family == "ball" and stands.shape is shape
    for part, other in zip(parts, stands.parts, strict=True):
        np.testing.assert_array_equal(other, part[:1])


@pytest.mark.parametrize("name", ["against_share", "frozen_share"])
@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan")])
def test_shares_are_between_none_and_all(as_shipped: None, name: str, share: float) -> None:
    with pytest.raises(ConfigError, match=f"{name}: expected 0 to 1"):
        WorldRecipe(**{name: share})

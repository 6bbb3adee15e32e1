"""Other requests for the same first image: what they say is what moves."""

import re
from dataclasses import replace

import pytest
import torch

from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.phrasings import VALIDATION
from diff4splat.captions.requests import (
    caption_of_absent_object,
    caption_of_object,
)
from diff4splat.captions.synonyms import COLOR_SYNONYMS, SIDES, names
from diff4splat.captions.vocabulary import NOUNS
from diff4splat.data.clip import Clip, ClipMetadata, ObjectNote, View
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import pinhole
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.training.batches.requests.draw import ObjectRequest, draw_request
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.stage import SampleKey

SIDE, FRAMES = 16, 3
DEPTHS = {1: 8.0, 2: 3.0, 3: 3.0, 4: 5.0}
OTHERS = DataSettings(other_object_share=1.0)
FILLED = {"name": "red ball", "moves": "moves", "move": "move", "moving": "moving", "side": "left"}
ABSENT = DataSettings(absent_object_share=1.0)
SINGLE = DataSettings(single_event_share=1.0)
MOTION = torch.rand(3, FRAMES, SIDE, SIDE, generator=torch.Generator().manual_seed(0))


def _note(instance: int, color: str, name: str, number: int) -> ObjectNote:
    return ObjectNote(instance=instance, color=color, name=name, motion="", object_number=number)


NOTES = (
    _note(1, "green", "ground", 1),
    _note(2, "red", "mug", 2),
    _note(3, "white", "mug", 2),
    _note(4, "blue", "box", 3),
)


def clip(notes: tuple[ObjectNote, ...] = NOTES) -> Clip:
    """A mug of two parts and a box before a ground."""
    instances = torch.ones(SIDE, SIDE, dtype=torch.uint8)
    instances[2:6, 2:6], instances[2:6, 6:8], instances[9:14, 9:14] = 2, 3, 4
    depth = torch.zeros(SIDE, SIDE)
    for number, value in DEPTHS.items():
        depth[instances == number] = value
    view = View(
        rgb=torch.zeros(FRAMES, SIDE, SIDE, 3, dtype=torch.uint8),
        depth=depth.repeat(FRAMES, 1, 1),
        cameras=pinhole(20.0, (SIDE, SIDE)).with_pose(torch.eye(4).repeat(FRAMES, 1, 1)),
        instances=instances.repeat(FRAMES, 1, 1),
    )
    note = ClipMetadata(identifier="x", source="test", license="CC0-1.0", objects=notes)
    return Clip(note=note, times_s=torch.arange(FRAMES).double(), views=(view,))


def requests(settings: DataSettings, count: int = 80, given: Clip | None = None) -> list:
    given = given or clip()
    return [
        draw_request(given, MOTION, settings, torch.Generator().manual_seed(seed))
        for seed in range(count)
    ]


def _asked(request: ObjectRequest) -> set[int]:
    moved = request.motion.norm(dim=0).amax(0) > 0
    return set(clip().views[0].instances[0][moved].tolist())


def test_what_a_caption_names_moves_whole_and_alone() -> None:
    seen = set()
    for request in requests(OTHERS):
        asked = _asked(request)
        words = set(request.caption.replace(",", "").split())
        mug = bool(words & {"red", "crimson", *" ".join(names("mug")).split()})
        assert asked == ({2, 3} if mug else {4}), request.caption
        moved = request.motion.norm(dim=0).amax(0) > 0
        instances = clip().views[0].instances[0].int()
        assert torch.equal(moved, torch.isin(instances, torch.tensor(sorted(asked)).int()))
        seen.add(mug)
    assert seen == {True, False}


def _direction(caption: str) -> str:
    """By the longest phrase that fits: "toward the left" is not toward the camera."""
    phrases = [(len(one), name) for name, each in SIDES.items() for one in each if one in caption]
    return max(phrases)[1]


def test_objects_move_as_one_and_to_the_side_that_is_asked_for() -> None:
    directions = {"left": (0, -1), "right": (0, 1), "toward": (2, -1), "away": (2, 1)}
    depth, seen = clip().views[0].depth[0], set()
    for request in requests(OTHERS):
        axis, sign = directions[_direction(request.caption)]
        moved = request.motion[:, -1].norm(dim=0) > 0
        ends = (request.motion[:, -1] * depth * UNIT)[:, moved].mT
        torch.testing.assert_close(ends, ends[:1].expand_as(ends))
        length = float(ends[0].norm())
        assert sign * float(ends[0, axis]) >= 0.9 * length, request.caption
        assert 0.1 <= length / float(depth[moved].median()) <= 0.5 + 1e-6
        seen.add(axis)
    assert seen == {0, 2}


def test_motion_starts_at_rest_and_is_even() -> None:
    for request in requests(OTHERS, 8):
        assert not bool(request.motion[:, 0].any())
        torch.testing.assert_close(2 * request.motion[:, 1], request.motion[:, 2])


def test_nothing_moves_for_an_absent_object() -> None:
    for request in requests(ABSENT):
        assert not bool(request.motion.any())
        words = request.caption.split()
        present = ("red", *names("mug")), ("blue", *names("box"))
        for color, *nouns in present:
            colors = {color, *COLOR_SYNONYMS.get(color, ())}
            ends = {noun.split()[-1] for noun in nouns}
            assert not (colors & set(words) and ends & set(words)), request.caption


def test_both_kinds_of_absent_objects_occur() -> None:
    captions = [request.caption for request in requests(ABSENT, 200)]
    present = {word for noun in ("mug", "box") for name in names(noun) for word in name.split()}
    wrong_color = [bool(present & set(caption.split())) for caption in captions]
    assert 0.2 < sum(wrong_color) / len(wrong_color) < 0.8


def test_a_name_that_fits_two_objects_is_not_used() -> None:
    notes = [NamedObject(color, "ball") for color in ("red", "orange", "blue")]
    generator = torch.Generator().manual_seed(0)
    assert caption_of_object(notes, 0, "left", generator) is None
    captions = [caption_of_object(notes, 2, "left", generator) for _ in range(40)]
    assert all("blue" in caption for caption in captions)


def test_an_image_of_everything_has_no_absent_noun_but_other_colors() -> None:
    notes = [NamedObject("red", noun) for noun in NOUNS]
    generator = torch.Generator().manual_seed(1)
    captions = [caption_of_absent_object(notes, generator) for _ in range(40)]
    assert not any("red " in caption or "crimson" in caption for caption in captions)


@pytest.mark.parametrize("lacking", ["instances", "depth"])
def test_clips_without_masks_or_depth_keep_their_own(lacking: str) -> None:
    view = replace(clip().views[0], **{lacking: None})
    for settings in (OTHERS, ABSENT):
        assert set(requests(settings, 4, replace(clip(), views=(view,)))) == {None}


def test_clips_without_named_objects_keep_their_own() -> None:
    for notes in ((), NOTES[:1]):
        assert set(requests(OTHERS, 4, clip(notes))) == {None}
        assert set(requests(ABSENT, 4, clip(notes))) == {None}


def test_shares_are_kept() -> None:
    settings = DataSettings(other_object_share=0.5, absent_object_share=0.2)
    found = requests(settings, 400)
    own = sum(request is None for request in found) / 400
    absent = sum(request is not None and not bool(request.motion.any()) for request in found) / 400
    assert own == pytest.approx(0.3, abs=0.07)
    assert absent == pytest.approx(0.2, abs=0.06)


@pytest.mark.parametrize("shares", [(0.8, 0.3), (-0.1, 0.0), (0.0, 1.1)])
def test_shares_must_fit_together(shares: tuple[float, float]) -> None:
    with pytest.raises(ConfigError, match="other_object_share"):
        DataSettings(other_object_share=shares[0], absent_object_share=shares[1])
    with pytest.raises(ConfigError, match="single_event_share"):
        DataSettings(single_event_share=shares[0], other_object_share=shares[1])


def test_no_caption_is_of_a_validation_template() -> None:
    patterns = [re.compile(re.sub(r"{\w+}", ".+", template)) for template in VALIDATION]
    assert all(any(each.fullmatch(one.format(**FILLED)) for each in patterns) for one in VALIDATION)
    for asked in requests(OTHERS) + requests(ABSENT):
        assert not any(pattern.fullmatch(asked.caption) for pattern in patterns), asked.caption


def moving_clip(caption: str, *motions: str) -> Clip:
    """With that caption, and with motions of ground, mug, its handle, and box."""
    notes = tuple(replace(one, motion=m) for one, m in zip(NOTES, motions, strict=True))
    given = clip(notes)
    return replace(given, note=replace(given.note, caption=caption))


BOTH = "in a room, a red mug rolls to the left beside a blue box, a blue box hops, the camera rises"


def test_one_event_moves_its_object_as_in_the_clip_and_no_other() -> None:
    found = requests(SINGLE, 20, moving_clip(BOTH, "", "rolls to the left", "rolls", "hops"))
    asked = {request.caption: request for request in found}
    mug, box = sorted(asked, key=len, reverse=True)
    assert mug == "in a room, a red mug rolls to the left beside a blue box"
    assert box == "a blue box hops"
    instances = clip().views[0].instances[0]
    for caption, parts in ((mug, (2, 3)), (box, (4,))):
        inside = torch.isin(instances, torch.tensor(parts, dtype=torch.uint8))
        assert torch.equal(asked[caption].motion, torch.where(inside, MOTION, 0.0))


def test_samples_have_the_words_of_one_event() -> None:
    settings = replace(SINGLE, size_px=(SIDE, SIDE), frames=FRAMES)
    given = moving_clip(BOTH, "", "rolls to the left", "rolls", "hops")
    origins = [Origin(key=SampleKey(0, "x", k, "sample"), source="made") for k in range(12)]
    captions = {make_sample(given, settings, origin).captions for origin in origins}
    mug = "in a room, a red mug rolls to the left beside a blue box"
    assert captions == {(mug,), ("a blue box hops",)}


@pytest.mark.parametrize(
    ("caption", "motions"),
    [
        ("a red mug spins, the camera rises", ("", "spins", "spins", "")),
        ("a green box rolls", ("", "rolls", "rolls", "")),
        ("a red mug rolls", ("", "", "", "")),
        ("a dog that runs after a ball", ("", "rolls", "rolls", "hops")),
        ("nothing moves", ("", "", "", "")),
        ("", ("", "", "", "")),
    ],
)
def test_clips_keep_their_caption_where_no_event_has_one_object(
    caption: str, motions: tuple[str, ...]
) -> None:
    assert set(requests(SINGLE, 8, moving_clip(caption, *motions))) == {None}


def test_two_objects_of_one_name_have_no_event_of_their_own() -> None:
    twins = (*NOTES[:3], replace(NOTES[3], color="red", name="mug", motion="rolls"))
    twins = tuple(replace(one, motion="rolls") if one.name == "mug" else one for one in twins)
    given = clip(twins)
    given = replace(given, note=replace(given.note, caption="a red mug rolls"))
    assert set(requests(SINGLE, 8, given)) == {None}

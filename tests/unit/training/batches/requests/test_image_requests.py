"""Prompts for one image: captions and masks agree, and every kind occurs."""

import re
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.cutout_nouns import CUTOUT_NOUNS, MESH_NOUNS
from diff4splat.captions.grammar import NamedObject, parse_caption
from diff4splat.captions.image_classes.class_nouns import noun_classes
from diff4splat.captions.synonyms import names
from diff4splat.captions.vocabulary import UNNAMED
from diff4splat.errors import InputError
from diff4splat.training.batches.requests import image_requests
from diff4splat.training.batches.requests.image_requests import ImageRequest, draw_image_requests
from diff4splat.training.batches.requests.present import (
    TRAINING_NOUNS,
    PresentObject,
    absent_nouns,
    name_maps,
)
from diff4splat.training.losses.object_mask import UNKNOWN_NAME

SIDE = 20
EMPTY = torch.zeros(SIDE, SIDE, dtype=torch.bool)


def _square(row: int, column: int, side: int) -> Tensor:
    mask = EMPTY.clone()
    mask[row : row + side, column : column + side] = True
    return mask


def present(color: str, noun: str, mask: Tensor, moves: bool = False) -> PresentObject:
    return PresentObject(named=NamedObject(color, noun), mask=mask, moves=moves)


OBJECTS = [
    present("red", "mug", _square(0, 0, 5), moves=True),
    present("blue", "box", _square(10, 10, 6)),
    present("green", "bush", _square(0, 10, 1)),
]
"""The last is too small to be asked for."""


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only nouns of the vocabulary."""
    shares = image_requests.KIND_SHARES | {"unknown": 0.0}
    monkeypatch.setattr(image_requests, "KIND_SHARES", shares)


def drawn(objects: list[PresentObject], count: int = 300) -> list[ImageRequest]:
    generator = torch.Generator().manual_seed(0)
    return draw_image_requests(objects, EMPTY, count, generator)


def _named(caption: str, noun: str, color: str) -> bool:
    words = set(caption.replace(",", "").split())
    return color in words or any(set(one.split()) <= words for one in names(noun))


def test_what_a_caption_says_is_what_its_mask_shows() -> None:
    seen = set()
    for request in drawn(OBJECTS):
        try:
            events = parse_caption(request.caption).events
        except InputError:
            continue
        subjects = {event.subject for event in events}
        asked = [one for one in OBJECTS if one.named in subjects]
        expected = torch.stack([EMPTY, *(one.mask for one in asked)]).any(0)
        assert torch.equal(request.mask, expected), request.caption
        seen.add((len(events), len(asked)))
    assert seen >= {(0, 0), (1, 0), (1, 1), (2, 2)}


@pytest.mark.usefixtures("known")
def test_free_sentences_ask_for_one_object_or_for_none() -> None:
    free = 0
    for request in drawn(OBJECTS):
        try:
            parse_caption(request.caption)
        except InputError:
            free += 1
            found = [one for one in OBJECTS if torch.equal(one.mask, request.mask)]
            assert found or not bool(request.mask.any())
            if found:
                color, noun = found[0].named.color, found[0].named.noun
                assert "crimson" in request.caption or _named(request.caption, noun, color)
    assert free > 90


def test_an_image_without_objects_asks_for_nothing() -> None:
    assert not any(bool(request.mask.any()) for request in drawn([], 60))


@pytest.mark.usefixtures("known")
def test_names_that_fit_two_are_asked_for_only_where_one_moves() -> None:
    twins = [
        present("red", "mug", _square(0, 0, 5), moves=True),
        present("red", "mug", _square(10, 10, 5)),
    ]
    masks = [request.mask for request in drawn(twins) if bool(request.mask.any())]
    assert masks and all(torch.equal(mask, twins[0].mask) for mask in masks)


def test_all_kinds_have_a_share() -> None:
    shares = image_requests.KIND_SHARES
    assert sum(shares.values()) == pytest.approx(1) and min(shares.values()) > 0
    empty = sum(not bool(request.mask.any()) for request in drawn(OBJECTS)) / 300
    assert 0.15 < empty < 0.4


def test_absent_nouns_are_those_of_training_worlds() -> None:
    assert "ball" in TRAINING_NOUNS and not {"mug", "gear"} & set(TRAINING_NOUNS)
    captions = " ".join(request.caption for request in drawn([], 300))
    assert "torus" in captions or "ring" in captions
    assert not {"gear", "cogwheel", "windmill", "pumpkin"} & set(captions.split())


def test_of_an_unknown_noun_the_colour_says_what_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_requests, "KIND_SHARES", {"unknown": 1.0})
    colors = {one.named.color: one.mask for one in OBJECTS}
    seen = set()
    for request in drawn(OBJECTS):
        said = set(COLOR_NAMES) & set(request.caption.replace(",", " ").split())
        color = said.pop() if said else "none"
        expected = {"none": OBJECTS[0].mask} | colors
        assert torch.equal(request.mask, expected.get(color, EMPTY)), request.caption
        assert not said and not {one.named.noun for one in OBJECTS} & set(request.caption.split())
        seen.add(color)
    assert seen > {"none", "red", "blue", "green"} and not seen & {"turquoise", "orange"}


CUTOUTS = [
    present("", "cat", _square(0, 0, 8)),
    present("red", "apple", _square(10, 10, 8)),
]
"""The cat has several colours."""


@pytest.mark.usefixtures("known")
def test_an_object_of_several_colours_is_asked_for_by_its_noun() -> None:
    asked = [request for request in drawn(CUTOUTS) if torch.equal(request.mask, CUTOUTS[0].mask)]
    assert len(asked) > 60
    for request in asked:
        words = set(request.caption.replace(",", " ").split())
        subject = words - {"red"} if "apple" in words else words
        assert "cat" in words and not set(COLOR_NAMES) & subject, request.caption


@pytest.mark.usefixtures("known")
def test_no_colour_alone_asks_beside_an_object_of_several() -> None:
    asked = [request for request in drawn(CUTOUTS) if torch.equal(request.mask, CUTOUTS[1].mask)]
    assert asked and all("apple" in request.caption for request in asked)


def test_absent_nouns_are_those_of_cutouts_too_beside_cutouts() -> None:
    nouns = set(CUTOUT_NOUNS) - {"cat", "apple", "animal"}
    absent = [r.caption for r in drawn(CUTOUTS, 600) if not bool(r.mask.any())]
    assert sum(any(f" {noun} " in f" {text} " for noun in nouns) for text in absent) > 8
    worlds = " ".join(request.caption for request in drawn(OBJECTS, 600))
    assert not {"astronaut", "zebra", "accordion"} & set(worlds.split())


def test_absent_nouns_are_those_of_meshes_too_beside_meshes() -> None:
    generator = torch.Generator().manual_seed(0)
    objects = {noun: [NamedObject("", noun)] for noun in ("stroller", "cat", "ball")}
    drawn_from = {
        noun: {absent_nouns(shown, generator) for _ in range(60)} for noun, shown in objects.items()
    }
    of_classes = {
        noun: {one for one in some if "abacus" in one and "abaya" in one}
        for noun, some in drawn_from.items()
    }
    for noun, (others,) in of_classes.items():
        shown = set(noun_classes(noun))
        assert noun not in others
        assert all(shown.isdisjoint(noun_classes(one)) for one in others)
        drawn_from[noun].remove(others)
    assert drawn_from["ball"] == {TRAINING_NOUNS}
    assert drawn_from["cat"] == {TRAINING_NOUNS, CUTOUT_NOUNS}
    assert drawn_from["stroller"] == {TRAINING_NOUNS, (*CUTOUT_NOUNS, *MESH_NOUNS)}


def test_names_without_a_number_are_marked() -> None:
    nouns, colors = name_maps(CUTOUTS, EMPTY)
    assert (nouns[:8, :8] == UNKNOWN_NAME).all() and (colors[:8, :8] == UNKNOWN_NAME).all()
    assert (nouns[10:18, 10:18] == UNKNOWN_NAME).all()
    assert (colors[10:18, 10:18] == 1 + COLOR_NAMES.index("red")).all()
    assert nouns[0, 10] == 0 and colors[0, 10] == 0


def test_an_image_in_which_nothing_moves_asks_no_more_for_absent_objects() -> None:
    still = [replace(one, moves=False) for one in OBJECTS]
    empty = [
        sum(not bool(r.mask.any()) for r in drawn(some, 900)) / 900 for some in (OBJECTS, still)
    ]
    assert empty[1] < empty[0] + 0.06


SHAPES = [
    present("red", UNNAMED, _square(0, 0, 5), moves=True),
    present("red", "ball", _square(10, 10, 6), moves=True),
    present("blue", UNNAMED, _square(0, 10, 6)),
]
"""Two random shapes beside a ball."""


def _words(caption: str) -> set[str]:
    return set(caption.replace(",", " ").replace(".", " ").split())


def test_an_unknown_noun_is_said_of_random_shapes_before_named_objects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(image_requests, "KIND_SHARES", {"unknown": 1.0})
    red = [r for r in drawn(SHAPES) if "red" in _words(r.caption)]
    assert red and all(torch.equal(request.mask, SHAPES[0].mask) for request in red)
    balls = [r for r in drawn(SHAPES[1:]) if "red" in _words(r.caption)]
    assert balls and all(torch.equal(request.mask, SHAPES[1].mask) for request in balls)


def test_random_shapes_are_asked_for_without_a_colour_by_an_unknown_noun_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(image_requests, "KIND_SHARES", {"named": 1.0})
    asked = [r.caption for r in drawn(SHAPES[1:]) if torch.equal(r.mask, SHAPES[2].mask)]
    without_color = [text for text in asked if not {"blue", "red"} & _words(text)]
    assert without_color and not {"object", "thing"} & set().union(*map(_words, without_color))


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_random_shapes_of_an_image_share_a_noun_or_are_objects(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(image_requests, "KIND_SHARES", {"two": 1.0})
    monkeypatch.setattr(image_requests, "GENERIC_SHARE", share)
    monkeypatch.setattr(image_requests, "GRAMMAR_SHARE", 1.0)
    said = [r.caption for r in drawn([SHAPES[0], SHAPES[2]]) if bool(r.mask.any())]
    nouns = [re.findall(r"(?:red|blue) (\w+)", text) for text in said]
    assert nouns and all(len(set(pair)) == 1 for pair in nouns)
    assert all((pair[0] == UNNAMED) == (share == 1.0) for pair in nouns)


def test_no_random_shape_is_called_object_beside_another_object_of_its_colour() -> None:
    called = [
        request
        for request in drawn(SHAPES, 900)
        if "red object" in request.caption and "beside" not in request.caption
    ]
    named = [request for request in called if torch.equal(request.mask, SHAPES[1].mask)]
    assert not named


def test_absent_objects_are_no_random_shapes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_requests, "KIND_SHARES", {"absent": 1.0})
    for request in drawn(SHAPES):
        assert not bool(request.mask.any())
        assert "object" not in _words(request.caption.partition(" beside ")[0])

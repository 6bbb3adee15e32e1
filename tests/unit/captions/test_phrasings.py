"""Free sentences: enough of them, true in a mirror, and a tenth that no network is trained on."""

import re

import pytest

from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.mirror import mirrored_caption
from diff4splat.captions.phrasings import (
    TRAINING,
    VALIDATION,
    Choices,
    any_object_name,
    noun_name,
    object_name,
    request,
)
from diff4splat.captions.synonyms import (
    COLOR_SYNONYMS,
    NOUN_SYNONYMS,
    SIDES,
    may_be_confused,
    names,
)
from diff4splat.captions.vocabulary import DIRECTIONS, NOUNS

IN_GRAMMAR = "a {name} {moves} {side}"
"""Mirrored with other words."""


def test_a_tenth_of_at_least_forty_templates_is_for_validation() -> None:
    assert len(set(TRAINING)) == len(TRAINING) >= 40
    assert not set(TRAINING) & set(VALIDATION)
    assert len(VALIDATION) >= 0.1 * len(TRAINING)


@pytest.mark.parametrize("template", TRAINING + VALIDATION)
def test_every_template_has_a_name_and_a_side(template: str) -> None:
    for direction, sides in SIDES.items():
        sentence = request("blue cup", direction, Choices(0), (template,))
        assert "blue cup" in sentence and sides[0] in sentence
        assert not re.search(r"[{}]", sentence)
    assert not re.search(r"\ba orange", request("orange cup", "left", Choices(0), (template,)))


@pytest.mark.parametrize("template", [one for one in TRAINING + VALIDATION if one != IN_GRAMMAR])
@pytest.mark.parametrize("side", range(len(SIDES["left"])))
def test_left_and_right_are_mirror_images(template: str, side: int) -> None:
    number = side * 7
    left = request("red ball", "left", Choices(number), (template,))
    right = request("red ball", "right", Choices(number), (template,))
    assert left != right
    assert mirrored_caption(left) == right
    assert mirrored_caption(right) == left


def test_the_first_phrase_of_a_side_is_that_of_the_grammar() -> None:
    assert {name: phrases[0] for name, phrases in SIDES.items()} == DIRECTIONS
    assert len(SIDES["left"]) == len(SIDES["right"])


def test_synonyms_are_of_known_nouns_and_of_one_alone() -> None:
    assert set(NOUN_SYNONYMS) <= set(NOUNS)
    assert not {other for each in NOUN_SYNONYMS.values() for other in each} & set(NOUNS)
    others = [other for each in (NOUN_SYNONYMS | COLOR_SYNONYMS).values() for other in each]
    assert len(set(others)) == len(others)
    assert names("mug")[0] == "mug" and names("star") == ("star",)


def test_names_that_fit_two_nouns() -> None:
    assert may_be_confused("tree", "fir tree") and may_be_confused("lamp", "street lamp")
    assert not may_be_confused("ball", "box")


def test_every_choice_is_made() -> None:
    cup = NamedObject("grey", "mug")
    numbers = range(200)
    assert {object_name(cup, Choices(n)) for n in numbers} >= {"grey mug", "gray coffee cup"}
    assert {noun_name("mug", Choices(n)) for n in numbers} == set(names("mug"))
    assert {any_object_name("red", Choices(n)) for n in numbers} == {"red object", "red thing"}

"""Classes of nouns and of prompts."""

import pytest

from diff4splat.captions.image_classes.class_nouns import (
    CLASSES,
    class_rows,
    classes_of_nouns,
    noun_classes,
)
from diff4splat.captions.image_classes.prompt_classes import prompt_classes
from diff4splat.captions.known_words import read_prompt

KANGAROO, TEDDY, SORREL = 104, 850, 339


def test_every_class_is_numbered_and_has_a_noun() -> None:
    numbers = {number for found in classes_of_nouns().values() for number in found}
    assert numbers <= set(range(CLASSES))
    assert len(numbers) > 0.95 * CLASSES


def test_no_noun_means_nearly_everything() -> None:
    assert all(0 < len(found) <= 130 for found in classes_of_nouns().values())


@pytest.mark.parametrize(
    ("noun", "classes"),
    [
        ("kangaroo", (KANGAROO,)),
        ("kangaroos", (KANGAROO,)),
        ("Kangaroo", (KANGAROO,)),
        ("teddy bear", (TEDDY,)),
        ("zorkel", ()),
        ("", ()),
    ],
)
def test_singular_plural_and_unknown(noun: str, classes: tuple[int, ...]) -> None:
    assert noun_classes(noun) == classes


def test_a_kind_belongs_to_its_noun() -> None:
    assert set(noun_classes("terrier")) < set(noun_classes("dog"))
    assert set(noun_classes("butterflies")) == set(noun_classes("butterfly"))


@pytest.mark.parametrize(
    ("prompt", "nouns"),
    [
        ("the kangaroo hops away", ["kangaroo"]),
        ("a red ball and a car roll past the tree", ["ball", "car"]),
        ("to the left moves the orange fox", ["fox"]),
        ("the teddy bear slides to the right", ["teddy bear"]),
        ("moves to the left: the cat on the table", ["cat"]),
        ("a rounded block slides past the car", []),
        ("move the rounded block past the car", []),
        ("a blue zorkel slides left", []),
        ("", []),
    ],
)
def test_what_moves_decides(prompt: str, nouns: list[str]) -> None:
    wanted = {number for noun in nouns for number in noun_classes(noun)}
    assert set(prompt_classes(prompt)) == wanted


def test_rows_have_the_classes_of_their_prompt() -> None:
    rows = class_rows([(1, 999), ()])
    assert rows.shape == (2, CLASSES)
    assert rows[0].nonzero().flatten().tolist() == [1, 999]
    assert not rows[1].any()
    assert class_rows([]).shape == (0, CLASSES)


def test_a_noun_of_a_class_is_a_known_object() -> None:
    read = read_prompt("the toucan flies to the left")
    assert read.objects == ("toucan",)
    assert not read.unknown

"""Prompts with and without words that the motion prior knows, and what the plan makes of them."""

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.events import (
    NO_MOTION_WORD,
    NO_OBJECT,
    ONLY_OF_PARTS,
    why_static,
)
from diff4splat.captions.grammar import CaptionFacts, Event, NamedObject, describe
from diff4splat.captions.known_words import (
    known_words,
    read_prompt,
    stem,
)
from diff4splat.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    NOUNS,
    OF_PARTS,
    PLACES,
    UNSEEN_NOUNS,
    VERBS,
)
from diff4splat.cli.main import run
from diff4splat.cli.options.models import prompt_notes
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES
from diff4splat.data_prep.synthetic.splits import load_split

OBJECTS = st.tuples(st.sampled_from(COLOR_NAMES), st.sampled_from(NOUNS))
EVENTS = st.tuples(OBJECTS, st.sampled_from(sorted(VERBS)), st.sampled_from(["", *DIRECTIONS]))
MOVES = st.lists(st.sampled_from(sorted(CAMERA_MOVES)), max_size=2)


@given(st.lists(EVENTS, max_size=2), st.sampled_from(["", *PLACES]), MOVES, st.integers(0, 5))
def test_every_training_caption_is_known_word_by_word(
    events: list, place: str, moves: list, variant: int
) -> None:
    named = [
        Event(subject=NamedObject(*subject), motion=motion, direction=direction)
        for subject, motion, direction in events
    ]
    facts = CaptionFacts(place=place, events=tuple(named), camera=tuple(moves))
    caption = describe(facts, variant)
    stays = [event.motion in OF_PARTS and not event.direction for event in named]
    reason = ONLY_OF_PARTS if named and all(stays) else ""
    assert why_static(caption) == reason
    assert read_prompt(caption).unknown == ()
    assert why_static(caption.upper()) == reason


@pytest.mark.parametrize(
    ("prompt", "reason"),
    [
        ("a zorkel moves to the left", NO_OBJECT),
        ("der Hund läuft nach links", NO_OBJECT),
        ("猫が歩く", NO_OBJECT),
        ("🚗💨", NO_OBJECT),
        ("12345", NO_OBJECT),
        ("the camera moves to the left", NO_OBJECT),
        ("a quiet house", NO_MOTION_WORD),
        ("the red car zooms off", NO_MOTION_WORD),
        ("the red car", NO_MOTION_WORD),
        ("an orange rounded block", NO_MOTION_WORD),
        ("the round table beside the rope", NO_MOTION_WORD),
        ("an orange rounded block spins", ""),
        ("moving cars", ""),
        ("a flag is fluttering", ONLY_OF_PARTS),
        ("nothing moves", ""),
        ("the blue one moves", ""),
        ("the blue zorkel walks", ""),
        ("a purple contraption flies away", ""),
        ("the sofa beside the red car moves", ""),
    ],
)
def test_a_prompt_needs_an_object_and_a_motion(prompt: str, reason: str) -> None:
    assert why_static(prompt) == reason


@pytest.mark.parametrize(
    "forms", ["move moves moving moved", "spin spins spinning", "fly flies flying", "box boxes"]
)
def test_endings_do_not_count(forms: str) -> None:
    assert len({stem(word) for word in forms.split()}) == 1


def test_a_trained_motion_prior_says_what_it_does_not_know() -> None:
    notes = partial(prompt_notes, model="small")

    (line,) = notes("a zorkel sings")
    assert "nothing moves: the prompt names no object" in line
    assert "diff4splat inspect words" in line
    unknown = "words of the prompt that the model does not know: {}"
    assert notes("the red zorkel moves") == [unknown.format("zorkel")]
    assert notes("the red car moves quickly") == [unknown.format("quickly")]
    assert notes("the red car moves to the left") == notes(None) == []
    assert notes("a zorkel sings", model="test") == []


def test_nouns_that_no_bundled_weights_know_count_as_unknown() -> None:
    found = read_prompt("the stroller moves to the left")
    assert found.objects == () and found.unknown == ("stroller",)
    assert read_prompt("the red stroller moves to the left").objects == ("red",)


def test_the_words_are_listed(capsys: pytest.CaptureFixture) -> None:
    assert run(["inspect", "words"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for words in known_words().values():
        assert all(word in text for word in words)


def test_unseen_nouns_are_those_that_training_worlds_leave_out() -> None:
    trained = {FAMILIES[name].noun for name in load_split("training").families.names}
    assert set(UNSEEN_NOUNS) == set(NOUNS) & {one.noun for one in FAMILIES.values()} - trained

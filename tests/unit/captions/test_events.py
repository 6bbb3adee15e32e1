"""The events of a prompt."""

import re
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from diff4splat.captions.cutout_nouns import KNOWN_NOUNS
from diff4splat.captions.events import (
    ONLY_OF_PARTS,
    is_in_place,
    local_motion,
    moving_events,
    split_events,
    why_static,
)
from diff4splat.captions.grammar import CaptionFacts, Event, NamedObject, describe
from diff4splat.captions.phrasings import TRAINING, VALIDATION
from diff4splat.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    IN_PLACE,
    OF_PARTS,
    PLACES,
    ROLLING,
    VERBS,
)

CAMERA = "the camera slides right and then moves back"


@pytest.mark.parametrize(
    "events",
    [
        ("a red ball rolls to the left", "a blue car drives away and stops"),
        ("in a meadow, a green flag flutters in the wind", "a balloon rises beside a tree"),
        ("the cup and the saucer move left", "the red cube hops"),
        ("a star rises", "an orange object bows and rises"),
        ("an arch swings to and fro beside an arch", "an arch glides"),
    ],
)
def test_every_event_is_a_piece(events: tuple[str, ...]) -> None:
    assert split_events(", ".join(events)) == events


@pytest.mark.parametrize(
    ("between", "whole"),
    [
        (" and ", True),
        (" while ", True),
        ("; ", True),
        (". ", True),
        (", then ", True),
        (" ", False),
    ],
)
def test_what_stands_between_events(between: str, whole: bool) -> None:
    pieces = ("The red ball rolls to the left", "the blue cube hops")
    expected = pieces if whole else (between.join(pieces),)
    assert split_events(between.join(pieces)) == expected


@pytest.mark.parametrize(
    "prompt",
    [
        "",
        "the ball moves up and down",
        "the red and blue ball moves left",
        "a red car and a blue car drive to the left",
        "the ball rolls left, toward the cube and the vase",
        "in a room, nothing moves around a blue stack of books and a yellow star",
        "a grey object bows and rises",
        "the camera moves to the left",
        "the ball rolls, the ball",
    ],
)
def test_one_event_is_the_prompt_itself(prompt: str) -> None:
    assert split_events(prompt) == (prompt,)


@pytest.mark.parametrize("template", [*TRAINING, *VALIDATION])
def test_free_sentences_about_one_object_are_one_event(template: str) -> None:
    words = {"name": "red torus", "moves": "glides", "move": "glide", "moving": "gliding"}
    sentence = template.format(side="to the left", **words)
    assert split_events(sentence) == (sentence,)


@pytest.mark.parametrize(
    ("prompt", "events"),
    [
        (f"a red box glides to the left, {CAMERA}", ("a red box glides to the left",)),
        ("the ball moves and the camera follows the car that moves", ("the ball moves",)),
        ("The camera rises, then a red ball rolls", ("a red ball rolls",)),
        (f"a star rises, {CAMERA}, a red ball rolls", ("a star rises", "a red ball rolls")),
        ("the view turns to the left while the ball rises", ("the ball rises",)),
        (f"nothing moves around a grey rock, {CAMERA}", ("nothing moves around a grey rock",)),
    ],
)
def test_camera_moves_are_no_part_of_an_event(prompt: str, events: tuple[str, ...]) -> None:
    assert split_events(prompt) == events


def test_two_directions_are_two_events() -> None:
    pieces = ("move the red cup to the left", "the blue spoon to the right")
    assert split_events(" and ".join(pieces)) == pieces


OBJECTS = st.builds(
    NamedObject, st.sampled_from(["", "red", "orange"]), st.sampled_from(KNOWN_NOUNS)
)
EVENTS = st.builds(
    Event,
    subject=OBJECTS,
    motion=st.sampled_from(list(VERBS)),
    direction=st.sampled_from(["", *DIRECTIONS]),
    beside=st.none() | OBJECTS,
)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(EVENTS, min_size=1, max_size=4),
    st.sampled_from(["", *PLACES]),
    st.lists(st.sampled_from(list(CAMERA_MOVES)), max_size=2),
    st.integers(0, 5),
)
def test_captions_have_as_many_pieces_as_events(
    events: list[Event], place: str, camera: list[tuple[str, int]], variant: int
) -> None:
    facts = CaptionFacts(place=place, events=tuple(events), camera=tuple(camera))
    caption = describe(facts, variant)
    without = describe(replace(facts, camera=()), variant)
    assert ", ".join(split_events(caption)) == without
    assert len(split_events(caption)) == len(events)


def stripped(text: str) -> str:
    """Without separators at its ends."""
    return re.sub(r"^[\s,;.]+|[\s,;.]+$", "", text)


@settings(deadline=None, max_examples=40)
@given(st.text(max_size=60))
@example(". 0")
def test_any_text_has_an_event(prompt: str) -> None:
    pieces = split_events(prompt)
    # Separators before the first event and after the last one belong to none.
    assert len(pieces) > 1 or stripped(pieces[0]) == stripped(prompt)
    assert all(piece in prompt for piece in pieces)


@pytest.mark.parametrize("motion", VERBS)
def test_every_phrase_ends_before_the_next_event(motion: str) -> None:
    torus, car = NamedObject("red", "torus"), NamedObject("", "car")
    first = Event(subject=car, motion=motion, direction="left", beside=torus)
    second = Event(subject=torus, motion=motion)
    for events in ((first, second), (second, first, second), (replace(first, direction=""),) * 3):
        for variant in range(4):
            caption = describe(CaptionFacts(events=events), variant)
            pieces = split_events(caption)
            assert ", ".join(pieces) == caption and len(pieces) == len(events), pieces


@pytest.mark.parametrize("direction", ["", *DIRECTIONS])
@pytest.mark.parametrize("motion", VERBS)
def test_motions_in_place_are_known_by_their_phrases(motion: str, direction: str) -> None:
    event = Event(subject=NamedObject("red", "torus"), motion=motion, direction=direction)
    for noun in (*KNOWN_NOUNS[::40], "rounded block"):
        subject = NamedObject("orange", noun)
        for variant in range(len(VERBS[motion])):
            caption = describe(CaptionFacts(events=(replace(event, subject=subject),)), variant)
            assert is_in_place(caption) is (motion in IN_PLACE and not direction), caption


@pytest.mark.parametrize(
    ("prompt", "in_place"),
    [
        ("the flag flutters", True),
        ("THE WINDMILL IS TURNING", True),
        ("the robot arm moves its joints", True),
        ("the robot arm moves", False),
        ("a ball grows and moves away", False),
        ("the ball spins to the left", False),
        ("the house", False),
        ("nothing moves", False),
        ("", False),
    ],
)
def test_a_direction_or_another_motion_moves_an_object(prompt: str, in_place: bool) -> None:
    assert is_in_place(prompt) is in_place


def test_motions_of_parts_are_passed_over_and_alone_they_are_a_reason() -> None:
    assert moving_events("a flag flutters, a red ball rolls") == ("a red ball rolls",)
    assert why_static("a flag flutters, a red ball rolls") == ""
    assert moving_events("a flag flutters, a robot arm moves its joints") == ()
    assert why_static("a flag flutters, a robot arm moves its joints") == ONLY_OF_PARTS


def test_events_in_place_move_an_object_about_itself() -> None:
    events = ("a bush sways in the wind", "a red ball spins")
    assert moving_events(", ".join(events)) == events
    assert [local_motion(event) for event in events] == ["sways", "spins"]


@pytest.mark.parametrize("motion", VERBS)
def test_every_phrase_of_a_motion_about_itself_is_known(motion: str) -> None:
    is_local = motion in (*ROLLING, *IN_PLACE) and motion not in OF_PARTS
    for noun in (*KNOWN_NOUNS[::40], "rounded block"):
        for direction in ("", "left"):
            event = Event(subject=NamedObject("orange", noun), motion=motion, direction=direction)
            for variant in range(len(VERBS[motion])):
                caption = describe(CaptionFacts(events=(event,)), variant)
                assert local_motion(caption) == (motion if is_local else ""), caption


@pytest.mark.parametrize(
    ("event", "motion"),
    [
        ("The Balloon is GROWING", "grows"),
        ("a wheel rolling away", "rolls"),
        ("the ball moves away and shrinks", "shrinks"),
        ("the windmill turns its sails", ""),
        ("the bush is static, the camera rolls clockwise", ""),
        ("the ball moves", ""),
        ("", ""),
    ],
)
def test_words_of_a_motion_about_itself(event: str, motion: str) -> None:
    assert local_motion(event) == motion

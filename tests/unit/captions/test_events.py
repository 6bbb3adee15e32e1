"""The events of a prompt."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.captions.events import split_events
from diff4splat.captions.grammar import CaptionFacts, Event, NamedObject, describe
from diff4splat.captions.vocabulary import CAMERA_MOVES, DIRECTIONS, PLACES, VERBS

CAMERA = "the camera slides right and then moves back"


@pytest.mark.parametrize(
    "events",
    [
        ("a red ball rolls to the left", "a blue car drives away and stops"),
        ("in a meadow, a green flag flutters in the wind", f"a balloon rises, {CAMERA}"),
        ("the cup and the saucer move left", "the red cube hops"),
        ("a star rises", "an orange object bows and rises"),
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
        f"a green box glides to the left beside a red object, {CAMERA}",
        "the ball moves left and the camera follows the car that moves",
        "a grey object bows and rises, the camera does not move",
        "the ball rolls, the ball",
    ],
)
def test_one_event_is_the_prompt_itself(prompt: str) -> None:
    assert split_events(prompt) == (prompt,)


OBJECTS = st.builds(
    NamedObject, st.sampled_from(["", "red", "grey"]), st.sampled_from(["torus", "car"])
)
EVENTS = st.builds(
    Event,
    subject=OBJECTS,
    motion=st.sampled_from(list(VERBS)),
    direction=st.sampled_from(["", *DIRECTIONS]),
    beside=st.none() | OBJECTS,
)


@settings(deadline=None)
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
    pieces = split_events(caption)
    assert ", ".join(pieces) == caption
    assert len(pieces) == len(events)


@settings(deadline=None)
@given(st.text(max_size=60))
def test_any_text_has_an_event(prompt: str) -> None:
    pieces = split_events(prompt)
    assert len(pieces) >= 1 and (len(pieces) > 1 or pieces[0] == prompt)
    assert all(piece in prompt for piece in pieces)

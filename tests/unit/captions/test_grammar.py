import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.captions.colors import COLOR_NAMES, color_name
from diff4splat.captions.counterfactual import rephrase
from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.captions.grammar import (
    CaptionFacts,
    Event,
    NamedObject,
    describe,
    motion_text,
    parse_caption,
)
from diff4splat.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    OPPOSITE,
    PLACES,
    VERBS,
)
from diff4splat.data_prep.synthetic.palettes import PALETTES, linear_from_hex
from diff4splat.errors import InputError

# plain words: building our classes inside a strategy would run their type checks there
things = st.tuples(st.sampled_from(("", *COLOR_NAMES)), st.sampled_from(ALL_NOUNS))
events = st.tuples(
    things,
    st.sampled_from(sorted(VERBS)),
    st.sampled_from(["", *DIRECTIONS]),
    st.none() | things,
)
cameras = st.lists(st.sampled_from(sorted(CAMERA_MOVES)), max_size=2)
places = st.sampled_from(["", *PLACES])


def event_of(thing: tuple, motion: str, direction: str, beside: tuple | None) -> Event:
    other = NamedObject(*beside) if beside else None
    return Event(subject=NamedObject(*thing), motion=motion, direction=direction, beside=other)


@settings(max_examples=60, deadline=None)
@given(
    place=places,
    told=st.lists(events, max_size=3),
    stands=st.lists(things, max_size=2),
    camera=cameras,
    variant=st.integers(0, 11),
)
def test_what_is_described_is_parsed_again(
    place: str, told: list, stands: list, camera: list, variant: int
) -> None:
    facts = CaptionFacts(
        place=place,
        events=tuple(event_of(*one) for one in told),
        static_objects=() if told else tuple(NamedObject(*one) for one in stands),
        camera=tuple(camera),
    )
    assert parse_caption(describe(facts, variant)) == facts


@pytest.mark.parametrize("table", [VERBS, CAMERA_MOVES])
def test_every_phrase_means_one_thing(table: dict) -> None:
    phrases = [phrase for words in table.values() for phrase in words]
    assert len(phrases) == len(set(phrases))
    assert not any(", " in phrase or " beside " in phrase for phrase in phrases)
    assert len(set(PLACES.values())) == len(PLACES)


def test_an_example() -> None:
    event = Event(subject=NamedObject("red", "torus"), motion="rolls", direction="left")
    facts = CaptionFacts(events=(event,), camera=(("orbit", 1),))
    caption = "a red torus rolls to the left, the camera circles right"
    assert describe(facts) == caption
    assert motion_text(event) == "rolls to the left"
    assert parse_caption(caption) == facts


def test_articles() -> None:
    facts = CaptionFacts(static_objects=(NamedObject("orange", "arch"),))
    assert describe(facts) == "nothing moves around an orange arch"


def test_counterfactuals() -> None:
    caption = "in a room, a red ball rolls to the left beside a blue box, the camera rises"
    assert "to the right beside a blue box" in rephrase(caption, "reverse")
    assert rephrase(rephrase(caption, "reverse"), "reverse") == caption
    assert (
        rephrase(caption, "still") == "in a room, nothing moves around a red ball, the camera rises"
    )
    assert parse_caption(rephrase(caption, "words", 1)) == parse_caption(caption)
    assert rephrase(caption, "words", 1) != caption
    assert {OPPOSITE[OPPOSITE[way]] for way in DIRECTIONS} == set(DIRECTIONS)


@pytest.mark.parametrize(
    ("caption", "words"),
    [
        ("", "what moves"),
        ("a red blob rolls", "an object such as"),
        ("red ball rolls", "an object such as"),
        ("a red ball explodes", "a motion"),
        ("a red ball rolls, the camera dances", "a camera move"),
        ("nothing moves, a red ball rolls", "nothing after stillness"),
        ("the camera rises", "what moves"),
    ],
)
def test_what_is_not_understood(caption: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        parse_caption(caption)
    assert "\n" not in str(caught.value)


def test_nothing_to_reverse_and_unknown_changes(as_shipped: None) -> None:
    with pytest.raises(InputError, match="direction to reverse"):
        rephrase("nothing moves", "reverse")
    with pytest.raises(InputError, match="expected reverse, still or words"):
        rephrase("nothing moves", "sing")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("c0202a", "red"), ("2244aa", "blue"), ("1a1a1a", "black"), ("f4f4f0", "white"),
        ("808080", "grey"), ("3a7a30", "green"), ("6a4528", "brown"), ("e8c840", "yellow"),
        ("e08030", "orange"), ("7040a0", "purple"), ("e090a8", "pink"), ("d8c098", "beige"),
        ("40a0a0", "turquoise"),
    ],
)  # fmt: skip
def test_names_of_colours(word: str, name: str) -> None:
    assert color_name(linear_from_hex(word)) == name


def test_paints_of_a_palette_have_several_names() -> None:
    for palette in PALETTES.values():
        assert len({color_name(color) for color in palette.colors("paint")}) >= 3

"""Captions of mirror images, and the same facts as people would put them."""

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.grammar import (
    CaptionFacts,
    Event,
    NamedObject,
    describe,
    parse_caption,
)
from diff4splat.captions.mirror import mirrored_caption
from diff4splat.captions.paraphrase import (
    FREE_BELOW,
    PLAIN_BELOW,
    SHORT_BELOW,
    SYNONYMS_BELOW,
    paraphrase,
)
from diff4splat.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    NOUNS,
    PLACES,
    VERBS,
)

IN_A_MIRROR = {"left": "right", "right": "left"}
# plain words: building our classes inside a strategy would run their type checks there
things = st.tuples(st.sampled_from(COLOR_NAMES), st.sampled_from(NOUNS))
events = st.tuples(
    things,
    st.sampled_from(sorted(VERBS)),
    st.sampled_from(["", *DIRECTIONS]),
    st.none() | things,
)
captions = st.fixed_dictionaries(
    {
        "place": st.sampled_from(["", *PLACES]),
        "told": st.lists(events, max_size=3),
        "stands": st.lists(things, max_size=2),
        "camera": st.lists(st.sampled_from(sorted(CAMERA_MOVES)), max_size=2),
    }
)
variants = st.integers(0, 11)
examples = settings(max_examples=60, deadline=None)


def facts_of(parts: dict) -> CaptionFacts:
    told = [
        Event(
            subject=NamedObject(*thing),
            motion=motion,
            direction=direction,
            beside=NamedObject(*beside) if beside else None,
        )
        for thing, motion, direction, beside in parts["told"]
    ]
    return CaptionFacts(
        place=parts["place"],
        events=tuple(told),
        static_objects=() if told else tuple(NamedObject(*one) for one in parts["stands"]),
        camera=tuple(parts["camera"]),
    )


@examples
@given(parts=captions, variant=variants)
def test_a_mirror_image_of_a_mirror_image_is_the_thing_itself(parts: dict, variant: int) -> None:
    facts = facts_of(parts)
    once = mirrored_caption(describe(facts, variant), variant + 1)
    assert parse_caption(mirrored_caption(once, variant)) == facts


@examples
@given(parts=captions, variant=variants)
def test_mirrors_exchange_left_and_right_and_nothing_else(parts: dict, variant: int) -> None:
    facts = facts_of(parts)
    seen = parse_caption(mirrored_caption(describe(facts, variant)))
    assert (seen.place, seen.static_objects) == (facts.place, facts.static_objects)
    for event, other in zip(facts.events, seen.events, strict=True):
        assert (other.subject, other.motion, other.beside) == (
            event.subject, event.motion, event.beside,
        )  # fmt: skip
        assert other.direction == IN_A_MIRROR.get(event.direction, event.direction)


@pytest.mark.parametrize(
    ("move", "mirrored"),
    [
        ("circles right", ("orbit", -1)),
        ("swings left and back", ("arc", 1)),
        ("rolls clockwise", ("roll", -1)),
        ("slides left", ("right", 1)),
        ("slides right", ("left", 1)),
        ("moves forward", ("forward", 1)),
        ("dollies out and narrows", ("dolly-zoom", -1)),
        ("rises", ("up", 1)),
        ("stands still", ("static", 0)),
    ],
)
def test_cameras_go_the_other_way_in_a_mirror(move: str, mirrored: tuple[str, int]) -> None:
    seen = parse_caption(mirrored_caption(f"nothing moves, the camera {move}"))
    assert seen.camera == (mirrored,)


def test_every_camera_move_has_a_mirror_image_that_can_be_said() -> None:
    for move in CAMERA_MOVES:
        caption = describe(CaptionFacts(camera=(move,)))
        again = mirrored_caption(mirrored_caption(caption))
        assert parse_caption(again).camera == (move,)


@pytest.mark.parametrize(
    ("caption", "mirrored"),
    [
        ("someone turns left, then right.", "someone turns right, then left."),
        ("is it left? right!", "is it right? left!"),
        ("the leftover is all right;", "the leftover is all left;"),
        ("two  blanks  left", "two  blanks  right"),
        ("a dog comes toward the camera", "a dog comes toward the camera"),
        ("", ""),
    ],
)
def test_words_of_another_grammar_are_exchanged_one_by_one(caption: str, mirrored: str) -> None:
    assert mirrored_caption(caption) == mirrored
    assert mirrored_caption(mirrored) == caption


@examples
@given(parts=captions, draw=st.floats(PLAIN_BELOW, 1, exclude_max=True), variant=variants)
def test_sentences_of_the_grammar_say_what_is_true(parts: dict, draw: float, variant: int) -> None:
    facts = facts_of(parts)
    said = parse_caption(paraphrase(describe(facts), draw, variant))
    assert (said.events, said.static_objects) == (facts.events, facts.static_objects)
    if draw < SHORT_BELOW:
        assert (said.place, said.camera) == ("", ())
    else:
        assert said == facts


@examples
@given(parts=captions, draw=st.floats(FREE_BELOW, PLAIN_BELOW, exclude_max=True), variant=variants)
def test_plain_sentences_say_one_true_thing(parts: dict, draw: float, variant: int) -> None:
    facts = facts_of(parts)
    said = paraphrase(describe(facts), draw, variant)
    if not facts.events:
        assert said == "nothing moves"
        return
    assert said.startswith("the ")
    # With its article it is a sentence of the grammar.
    named = said.removeprefix("the ")
    article = "an" if named[0] in "aeiou" else "a"
    (event,) = parse_caption(f"{article} {named}").events
    told = [(one.subject, one.direction) for one in facts.events]
    assert (event.subject, event.direction) in told
    motions = {one.motion for one in facts.events if one.subject == event.subject}
    assert event.motion in (motions if not event.direction else motions | {"slides"})
    assert event.beside is None


@examples
@given(told=st.lists(events, min_size=2, max_size=3))
def test_plain_sentences_are_about_each_thing_in_turn(told: list) -> None:
    assume(len({thing for thing, *_ in told}) == len(told))
    facts = facts_of({"place": "", "told": told, "stands": [], "camera": []})
    caption = describe(facts)
    for variant, event in enumerate(facts.events):
        start = f"the {event.subject.color} {event.subject.noun} "
        assert paraphrase(caption, FREE_BELOW, variant).startswith(start)


def test_examples() -> None:
    caption = "in a room, a red ball rolls to the left beside a blue box, the camera rises"
    assert paraphrase(caption, 0.0, 0) == "the red ball moves to the left"
    assert paraphrase(caption, 0.0, 3) == "the crimson sphere moves to the left"
    assert paraphrase("a red ball spins", 0.0, 0) == "the red ball spins"
    assert paraphrase(caption, FREE_BELOW, 0) == "the red ball slides to the left"
    assert paraphrase(caption, FREE_BELOW, 2) == "the red ball moves to the left"
    assert paraphrase(caption, PLAIN_BELOW, 0) == "a red ball rolls to the left beside a blue box"
    assert paraphrase(caption, SHORT_BELOW, 1).startswith(
        "in a room, a red ball is rolling to the le"
    )
    assert paraphrase(caption, SYNONYMS_BELOW, 1) == caption


@pytest.mark.parametrize("draw", [0.0, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("caption", ["", "a dog runs to the left.", "the camera rises"])
def test_captions_of_another_grammar_stay(caption: str, draw: float) -> None:
    assert paraphrase(caption, draw, 3) == caption

"""Captions as facts and back.

    caption   = [ place ", " ] ( event { ", " event } | stillness ) [ ", " camera ] ;
    event     = thing " " verb [ " " direction ] [ " beside " thing ] ;
    stillness = "nothing moves" [ " around " thing { " and " thing } ] ;
    thing     = ( "a" | "an" ) " " color " " noun ;
    direction = "to the left" | "to the right"
              | "toward the camera" | "away from the camera" ;
    camera    = "the camera " move { " and then " move } ;

``place``, ``verb``, ``noun``, ``color`` and ``move`` are the words of ``vocabulary``. Left and
right are the input camera's at the first frame; verbs without a direction are motions that stay in
place or go up or down by themselves.
"""

from dataclasses import dataclass

from diff4splat.data_prep.synthetic.captions.colors import COLOR_NAMES
from diff4splat.data_prep.synthetic.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    NOUNS,
    PLACES,
    VERBS,
)
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True)
class Thing:
    """What is named."""

    color: str
    noun: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something moves."""

    thing: Thing
    motion: str
    """Key of ``MOTIONS``."""
    direction: str = ""
    """``left``, ``right``, ``toward``, ``away`` or empty."""
    beside: Thing | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptionFacts:
    """Everything a caption says."""

    place: str = ""
    """Key of ``SCENE_KINDS``."""
    events: tuple[Event, ...] = ()
    """Empty: nothing moves."""
    standing: tuple[Thing, ...] = ()
    """Named where nothing moves."""
    camera: tuple[tuple[str, int], ...] = ()
    """(preset, sign) of each segment of the input view's path."""


def describe(facts: CaptionFacts, variant: int = 0) -> str:
    """A caption; ``variant`` chooses among synonyms."""
    clauses = [PLACES[facts.place]] if facts.place else []
    clauses += [_event(event, variant + k) for k, event in enumerate(facts.events)]
    if not facts.events:
        around = " around " + " and ".join(map(_thing, facts.standing)) if facts.standing else ""
        clauses.append(f"nothing moves{around}")
    if facts.camera:
        moves = [_pick(CAMERA_MOVES[move], variant) for move in facts.camera]
        clauses.append("the camera " + " and then ".join(moves))
    return ", ".join(clauses)


def motion_text(event: Event, variant: int = 0) -> str:
    """What an object note says of a motion."""
    direction = f" {DIRECTIONS[event.direction]}" if event.direction else ""
    return _pick(VERBS[event.motion], variant) + direction


def _event(event: Event, variant: int) -> str:
    beside = f" beside {_thing(event.beside)}" if event.beside else ""
    return f"{_thing(event.thing)} {motion_text(event, variant)}{beside}"


def _thing(thing: Thing) -> str:
    article = "an" if thing.color[0] in "aeiou" else "a"
    return f"{article} {thing.color} {thing.noun}"


def _pick(words: tuple[str, ...], variant: int) -> str:
    return words[variant % len(words)]


def parse_caption(text: str) -> CaptionFacts:
    """The facts that a caption of this grammar states.

    Raises:
        InputError: with the words that are not understood.
    """
    clauses = text.strip().split(", ") if text.strip() else []
    place = next((key for key, words in PLACES.items() if words == (clauses or [""])[0]), "")
    clauses = clauses[1:] if place else clauses
    camera: tuple[tuple[str, int], ...] = ()
    if clauses and clauses[-1].startswith("the camera "):
        words = clauses.pop().removeprefix("the camera ")
        camera = tuple(_move(word) for word in words.split(" and then "))
    if not clauses:
        raise InputError(f"caption: expected what moves or 'nothing moves', got {text[:60]!r}")
    if clauses[0].startswith("nothing moves"):
        return CaptionFacts(place=place, standing=_standing(clauses), camera=camera)
    return CaptionFacts(place=place, events=tuple(map(_parsed_event, clauses)), camera=camera)


def _move(words: str) -> tuple[str, int]:
    for move, phrases in CAMERA_MOVES.items():
        if words in phrases:
            return move
    raise InputError(f"caption: expected a camera move, got {words[:60]!r}")


def _standing(clauses: list[str]) -> tuple[Thing, ...]:
    rest = clauses[0].removeprefix("nothing moves").removeprefix(" around ")
    if len(clauses) > 1:
        raise InputError(f"caption: expected nothing after stillness, got {clauses[1][:60]!r}")
    return tuple(_parsed_thing(part)[0] for part in rest.split(" and ")) if rest else ()


def _parsed_thing(words: str) -> tuple[Thing, str]:
    """A thing and the words after it."""
    article, _, rest = words.partition(" ")
    color, _, rest = rest.partition(" ")
    nouns = [noun for noun in NOUNS if rest == noun or rest.startswith(f"{noun} ")]
    if article not in ("a", "an") or color not in COLOR_NAMES or not nouns:
        raise InputError(f"caption: expected a thing such as 'a red torus', got {words[:60]!r}")
    noun = max(nouns, key=len)
    return Thing(color, noun), rest[len(noun) :].strip()


def _parsed_event(clause: str) -> Event:
    words, _, other = clause.partition(" beside ")
    thing, rest = _parsed_thing(words)
    beside = _parsed_thing(other)[0] if other else None
    for direction, phrase in DIRECTIONS.items():
        if rest.endswith(f" {phrase}"):
            verb = rest.removesuffix(f" {phrase}")
            return Event(thing=thing, motion=_motion(verb), direction=direction, beside=beside)
    return Event(thing=thing, motion=_motion(rest), beside=beside)


def _motion(verb: str) -> str:
    for motion, phrases in VERBS.items():
        if verb in phrases:
            return motion
    raise InputError(f"caption: expected a motion, got {verb[:60]!r}")

"""Write captions from facts, and parse them back.

    caption   = [ place ", " ] ( event { ", " event } | static ) [ ", " camera ] ;
    event     = object " " verb [ " " direction ] [ " beside " object ] ;
    static    = "nothing moves" [ " around " object { " and " object } ] ;
    object    = ( "a" | "an" ) [ " " color ] " " noun ;
    direction = "to the left" | "to the right"
              | "toward the camera" | "away from the camera" ;
    camera    = "the camera " move { " and then " move } ;

``place``, ``verb``, ``noun``, ``color`` and ``move`` are the words of ``vocabulary``. Left and
right refer to the input camera at the first frame. Verbs without a direction are motions in place,
or upward and downward motions.
"""

from dataclasses import dataclass

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.captions.vocabulary import (
    CAMERA_MOVES,
    DIRECTIONS,
    PLACES,
    UNNAMED,
    VERBS,
)
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True)
class NamedObject:
    """An object, as captions name it."""

    color: str
    """Empty for an object of several colours."""
    noun: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One object moves."""

    subject: NamedObject
    motion: str
    """Key of ``VERBS``."""
    direction: str = ""
    """``left``, ``right``, ``toward``, ``away`` or empty."""
    beside: NamedObject | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptionFacts:
    """The content of a caption."""

    place: str = ""
    """Key of ``PLACES``, or empty."""
    events: tuple[Event, ...] = ()
    """Empty if nothing moves."""
    static_objects: tuple[NamedObject, ...] = ()
    """Objects that are named if nothing moves."""
    camera: tuple[tuple[str, int], ...] = ()
    """(preset, sign) of each segment of the input camera's path."""


def describe(facts: CaptionFacts, variant: int = 0) -> str:
    """Write a caption; ``variant`` selects among synonyms."""
    clauses = [PLACES[facts.place]] if facts.place else []
    clauses += [_event(event, variant + k) for k, event in enumerate(facts.events)]
    if not facts.events:
        clauses.append(_nothing_moves(facts.static_objects))
    if facts.camera:
        moves = [_pick(CAMERA_MOVES[move], variant) for move in facts.camera]
        clauses.append("the camera " + " and then ".join(moves))
    return ", ".join(clauses)


def motion_text(event: Event, variant: int = 0) -> str:
    """The verb and direction of an event."""
    direction = f" {DIRECTIONS[event.direction]}" if event.direction else ""
    return _pick(VERBS[event.motion], variant) + direction


def _nothing_moves(static_objects: tuple[NamedObject, ...]) -> str:
    around = " around " + " and ".join(map(_object, static_objects)) if static_objects else ""
    return f"nothing moves{around}"


def _event(event: Event, variant: int) -> str:
    beside = f" beside {_object(event.beside)}" if event.beside else ""
    return f"{_object(event.subject)} {motion_text(event, variant)}{beside}"


def _object(named: NamedObject) -> str:
    name = f"{named.color} {named.noun}".strip()
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _pick(words: tuple[str, ...], variant: int) -> str:
    return words[variant % len(words)]


def parse_caption(text: str) -> CaptionFacts:
    """Parse a caption of this grammar.

    Raises:
        InputError: with the words outside the grammar.
    """
    clauses = text.strip().split(", ") if text.strip() else []
    place = next((key for key, words in PLACES.items() if words == (clauses or [""])[0]), "")
    clauses = clauses[1:] if place else clauses
    camera: tuple[tuple[str, int], ...] = ()
    if clauses and clauses[-1].startswith("the camera "):
        words = clauses.pop().removeprefix("the camera ")
        camera = tuple(_parse_move(word) for word in words.split(" and then "))
    if not clauses:
        raise InputError(f"caption: expected what moves or 'nothing moves', got {text[:60]!r}")
    if clauses[0].startswith("nothing moves"):
        return CaptionFacts(place=place, static_objects=_static_objects(clauses), camera=camera)
    return CaptionFacts(place=place, events=tuple(map(_parse_event, clauses)), camera=camera)


def _parse_move(words: str) -> tuple[str, int]:
    for move, phrases in CAMERA_MOVES.items():
        if words in phrases:
            return move
    raise InputError(f"caption: expected a camera move, got {words[:60]!r}")


def _static_objects(clauses: list[str]) -> tuple[NamedObject, ...]:
    rest = clauses[0].removeprefix("nothing moves").removeprefix(" around ")
    if len(clauses) > 1:
        raise InputError(f"caption: expected nothing after stillness, got {clauses[1][:60]!r}")
    return tuple(_parse_object(part)[0] for part in rest.split(" and ")) if rest else ()


def _parse_object(words: str) -> tuple[NamedObject, str]:
    """The object at the start of ``words``, and the words after it."""
    article, _, rest = words.partition(" ")
    color, _, after = rest.partition(" ")
    color, rest = (color, after) if color in COLOR_NAMES else ("", rest)
    nouns = [noun for noun in (*ALL_NOUNS, UNNAMED) if rest == noun or rest.startswith(f"{noun} ")]
    if article not in ("a", "an") or not nouns:
        raise InputError(f"caption: expected an object such as 'a red torus', got {words[:60]!r}")
    noun = max(nouns, key=len)
    return NamedObject(color, noun), rest[len(noun) :].strip()


def _parse_event(clause: str) -> Event:
    words, _, other = clause.partition(" beside ")
    subject, rest = _parse_object(words)
    beside = _parse_object(other)[0] if other else None
    for direction, phrase in DIRECTIONS.items():
        if rest.endswith(f" {phrase}"):
            verb = rest.removesuffix(f" {phrase}")
            return Event(
                subject=subject, motion=_parse_motion(verb), direction=direction, beside=beside
            )
    return Event(subject=subject, motion=_parse_motion(rest), beside=beside)


def _parse_motion(verb: str) -> str:
    for motion, phrases in VERBS.items():
        if verb in phrases:
            return motion
    raise InputError(f"caption: expected a motion, got {verb[:60]!r}")

"""The events of a prompt: each says what one object does.

    a red ball rolls to the left, a blue car and its trailer drive away and stop, the camera rises
    └─ event ───────────────────┘ └─ event ────────────────────────────────────┘

A piece without an object or a motion of its own belongs to the event before it: ``and stop``. A
place belongs to the event after it. Camera moves belong to none: their directions are not those of
objects.
"""

import re
from functools import cache

from diff4splat.captions.known_words import read_prompt, stem, words_of
from diff4splat.captions.synonyms import TRAVEL_VERBS
from diff4splat.captions.vocabulary import IN_PLACE, OF_PARTS, ROLLING, VERBS

NO_OBJECT = "the prompt names no object or colour that the model knows"
NO_MOTION_WORD = "the prompt names no motion or direction that the model knows"
ONLY_OF_PARTS = "the prompt asks only for motion of parts, and objects are moved as a whole"

_SEPARATOR = re.compile(r"\s*[,;.]\s+(?:(?:and|while|then)\s+)*|\s+(?:and|while)\s+", re.IGNORECASE)
_GOES_ON = re.compile(
    r"(?:above|around|beside|by|fro|from|into|like|of|onto|over|toward|with)\b", re.IGNORECASE
)
"""What begins so belongs to the event before it: over and over, to and fro."""
_CAMERA = re.compile(r"(?:the )?(?:camera|view)\b", re.IGNORECASE)
_NO_MOTION = re.compile(r"\b(?:camera|view|nothing|all else)\b.*", re.IGNORECASE | re.DOTALL)
"""From here on nothing is said about an object that moves."""


def split_events(prompt: str) -> tuple[str, ...]:
    """The prompt in pieces of one event each; the prompt itself if it says nothing of objects."""
    events: list[str] = []
    current, gap, in_camera = "", "", False
    for start, end, next_start in _pieces(prompt):
        piece, begins = prompt[start:end], _begins_event(prompt[start:])
        in_camera = bool(_CAMERA.match(piece)) or (in_camera and not begins)
        if not in_camera:
            if current and begins and _is_event(current):
                events.append(current)
                current = ""
            current = current + gap + piece if current else piece
        gap = prompt[end:next_start]
    return (*events, current) if current else (prompt,)


def moving_events(prompt: str) -> tuple[str, ...]:
    """The events that move an object as a whole: it is elsewhere after them, or moves in place."""
    events = split_events(prompt)
    return tuple(event for event in events if local_motion(event) or not is_in_place(event))


def why_static(prompt: str) -> str:
    """Why ``prompt`` moves nothing; empty where it may."""
    words = read_prompt(prompt)
    if not words.objects:
        return NO_OBJECT
    if not words.motions:
        return NO_MOTION_WORD
    return "" if moving_events(prompt) else ONLY_OF_PARTS


def is_in_place(event: str) -> bool:
    """Whether an object only turns, bends or changes its size, with no direction beside that."""
    phrases, verbs = _words_in_place()
    stems = _stem(event.casefold())
    other = stems
    for phrase in phrases:
        other = re.sub(rf"\b{phrase}\b", "", other)
    motions = [word for word in other.split() if read_prompt(word).motions]
    return all(word in verbs for word in motions) and (bool(motions) or other != stems)


def local_motion(event: str) -> str:
    """Motion of the object about itself, as in ``VERBS``: turning, growing, bending; or empty."""
    words = _stem(_NO_MOTION.sub("", event).casefold())
    for phrase, motion in _local_phrases():
        if re.search(rf"\b{phrase}\b", words):
            return motion
    return ""


@cache
def _local_phrases() -> tuple[tuple[str, str], ...]:
    """Stems of phrases with their motion, longest first."""
    local = [motion for motion in (*ROLLING, *IN_PLACE) if motion not in OF_PARTS]
    phrases = [(_stem(phrase), motion) for motion in local for phrase in VERBS[motion]]
    return tuple(sorted(phrases, key=lambda one: -len(one[0])))


@cache
def _words_in_place() -> tuple[tuple[str, ...], frozenset[str]]:
    """Stems of the phrases of motions in place, longest first, and of verbs of no other motion."""
    phrases = [phrase for motion in IN_PLACE for phrase in VERBS[motion]]
    others = [VERBS[motion] for motion in VERBS if motion not in IN_PLACE]
    travel = [_stem(words) for forms in (*others, *TRAVEL_VERBS) for words in forms]
    stems = [_stem(phrase) for phrase in phrases]
    verbs = frozenset(" ".join(stems).split()) - frozenset(" ".join(travel).split())
    return tuple(sorted(stems, key=len, reverse=True)), verbs


def _stem(text: str) -> str:
    return " ".join(map(stem, words_of(text)))


def _pieces(prompt: str) -> list[tuple[int, int, int]]:
    """Start and end of what lies between separators, and the start of the next."""
    found, start = [], 0
    for separator in _SEPARATOR.finditer(prompt):
        found.append((start, separator.start(), separator.end()))
        start = separator.end()
    return [*found, (start, len(prompt), len(prompt))]


def _is_event(words: str) -> bool:
    """Whether an object and a motion are named."""
    return {"object", "motion"} <= set(_kinds(words))


def _begins_event(words: str) -> bool:
    """Whether an object is named first; its motion may follow in a later piece."""
    kinds = _kinds(_SEPARATOR.split(words, maxsplit=1)[0])
    return kinds[:1] == ["object"] and not _GOES_ON.match(words) and _is_event(words)


def _kinds(words: str) -> list[str]:
    """Objects and motions in their order; ``rises`` is no ``rice``."""
    found = []
    for word in words_of(_NO_MOTION.sub("", words)):
        read = read_prompt(word)
        if read.motions or read.objects:
            found.append("motion" if read.motions else "object")
    return found

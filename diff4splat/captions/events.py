"""The events of a prompt: each says what one object does.

    a red ball rolls to the left, a blue car and its trailer drive away and stop, the camera rises
    └─ event ───────────────────┘ └─ event ────────────────────────────────────┘

A piece without an object or a motion of its own belongs to the event before it: ``and stop``. A
place belongs to the event after it. Camera moves belong to none: their directions are not those of
objects.
"""

import re

from diff4splat.captions.known_words import read_prompt

_SEPARATOR = re.compile(r"\s*[,;.]\s+(?:(?:and|while|then)\s+)*|\s+(?:and|while)\s+", re.IGNORECASE)
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
    return kinds[:1] == ["object"] and _is_event(words)


def _kinds(words: str) -> list[str]:
    """Objects and motions in their order; ``rises`` is no ``rice``."""
    found = []
    for word in re.findall(r"[^\W\d_]+", _NO_MOTION.sub("", words)):
        read = read_prompt(word)
        if read.motions or read.objects:
            found.append("motion" if read.motions else "object")
    return found

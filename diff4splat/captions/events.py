"""The events of a prompt: each says what one object does.

    a red ball rolls to the left, a blue car and its trailer drive away and stop
    └─ event ───────────────────┘ └─ event ────────────────────────────────────┘

A piece without an object or a motion of its own belongs to the event before it: ``and stop``, a
camera move. A place belongs to the event after it. One event is the prompt, word for word.
"""

import re

from diff4splat.captions.known_words import read_prompt

_SEPARATOR = re.compile(r"\s*[,;.]\s+(?:(?:and|while|then)\s+)*|\s+(?:and|while)\s+", re.IGNORECASE)
_CAMERA = re.compile(r"\b(?:camera|view)\b.*", re.IGNORECASE | re.DOTALL)


def split_events(prompt: str) -> tuple[str, ...]:
    """The prompt in pieces of one event each; the prompt itself if it has fewer than two."""
    events, start = [], 0
    for separator in _SEPARATOR.finditer(prompt):
        event, rest = prompt[start : separator.start()], prompt[separator.end() :]
        if _is_event(event) and _begins_event(rest):
            events.append(event)
            start = separator.end()
    return (*events, prompt[start:]) if events else (prompt,)


def _is_event(words: str) -> bool:
    """Whether an object and a motion are named."""
    return {"object", "motion"} <= set(_kinds(words))


def _begins_event(words: str) -> bool:
    """Whether an object is named first; its motion may follow in a later piece."""
    kinds = _kinds(_SEPARATOR.split(words, maxsplit=1)[0])
    return kinds[:1] == ["object"] and _is_event(words)


def _kinds(words: str) -> list[str]:
    """Objects and motions in their order, up to the camera's; ``rises`` is no ``rice``."""
    found = []
    for word in re.findall(r"[^\W\d_]+", _CAMERA.sub("", words)):
        read = read_prompt(word)
        if read.motions or read.objects:
            found.append("motion" if read.motions else "object")
    return found

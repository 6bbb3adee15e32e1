"""The classes of what a prompt asks to move."""

from functools import cache
from itertools import chain

from diff4splat.captions.image_classes.class_nouns import MOST_WORDS, noun_classes
from diff4splat.captions.known_words import known_words, read_prompt, words_of


def prompt_classes(prompt: str) -> tuple[int, ...]:
    """ImageNet's classes of the objects before the first motion word, or else of the first object.

    ``a red ball and a car roll past the tree``: of balls and cars. Empty where none of them has
    classes: the image classifier says nothing then.
    """
    words = words_of(prompt)
    first = next((k for k, word in enumerate(words) if read_prompt(word).motions), len(words))
    objects = _objects(words[:first]) or _objects(words[first:])[:1]
    return tuple(sorted(set(chain.from_iterable(objects))))


def _objects(words: list[str]) -> list[tuple[int, ...]]:
    """The classes of every object; none for one that captions know and ImageNet does not."""
    found, start = [], 0
    while start < len(words):
        taken, classes = _noun_at(words, start)
        if classes is not None:
            found.append(classes)
        start += taken
    return found


def _noun_at(words: list[str], start: int) -> tuple[int, tuple[int, ...] | None]:
    """Number of words of the longest noun that begins here, and its classes; None without one."""
    word = words[start]
    if word in _colors():
        return 1, None
    for taken in range(min(MOST_WORDS, len(words) - start), 0, -1):
        if classes := noun_classes(" ".join(words[start : start + taken])):
            return taken, classes
    return 1, () if read_prompt(word).objects else None


@cache
def _colors() -> frozenset[str]:
    return frozenset(known_words()["colours"])

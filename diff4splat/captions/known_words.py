"""The words of a prompt that the networks know: those of captions, and nouns of ImageNet's classes.

A prompt moves something if it has a word for an object (a noun or a colour) and one for a motion (a
verb or a direction). A colour is enough, even beside a noun that the model does not know. Endings
do not count: ``moving`` is ``moves``.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.cutout_nouns import KNOWN_NOUNS
from diff4splat.captions.image_classes.class_nouns import noun_classes
from diff4splat.captions.synonyms import (
    ANY_OBJECT,
    COLOR_SYNONYMS,
    NOUN_SYNONYMS,
    SIDES,
    TRAVEL_VERBS,
)
from diff4splat.captions.vocabulary import CAMERA_MOVES, PLACES, VERBS

STATIC = "nothing moves"
_ENDINGS = ("ing", "ed", "es", "s", "e")
_LEAST_STEM = 3
_FUNCTION_WORDS = frozenset(
    [
        *("a", "an", "and", "are", "at", "by", "for", "from", "has", "in", "into", "is", "it"),
        *("its", "of", "off", "on", "onto", "out", "over", "the", "then", "to", "with"),
        *("above", "around", "beside", "camera", "gets", "joints", "like", "one", "ones", "way"),
        *("circle", "fro", "itself", "jelly", "rope", "round", "sails", "us", "viewer", "wings"),
    ]
)
"""Words that neither name an object nor a motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptWords:
    """The words of one prompt, by what the motion prior takes them for."""

    objects: tuple[str, ...]
    motions: tuple[str, ...]
    unknown: tuple[str, ...]


def known_words() -> dict[str, tuple[str, ...]]:
    """Every phrase, by kind."""
    travel = tuple(form for forms in TRAVEL_VERBS for form in forms)
    return {
        "objects": (*_with_synonyms(KNOWN_NOUNS, NOUN_SYNONYMS), *ANY_OBJECT),
        "colours": _with_synonyms(COLOR_NAMES, COLOR_SYNONYMS),
        "motions": (*(phrase for phrases in VERBS.values() for phrase in phrases), *travel),
        "directions": tuple(phrase for phrases in SIDES.values() for phrase in phrases),
        "places": tuple(PLACES.values()),
        "nothing": (STATIC,),
    }


def _with_synonyms(
    words: tuple[str, ...], synonyms: Mapping[str, tuple[str, ...]]
) -> tuple[str, ...]:
    every = (one for word in words for one in (word, *synonyms.get(word, ())))
    return tuple(dict.fromkeys(every))


@lru_cache(4096)
def read_prompt(prompt: str) -> PromptWords:
    """Sort the words of ``prompt``; function words and places are left out."""
    objects, motions, every = _stems()
    words = [(word, stem(word)) for word in words_of(prompt)]
    unknown = [word for word, root in words if root not in every]
    # What the image classifier knows, but no caption of training has.
    classes = {word for word in unknown if noun_classes(word)}
    return PromptWords(
        objects=tuple(word for word, root in words if root in objects or word in classes),
        motions=tuple(word for word, root in words if root in motions),
        unknown=tuple(word for word in unknown if word not in classes),
    )


def words_of(text: str) -> list[str]:
    """Runs of letters, in lower case."""
    return re.findall(r"[^\W\d_]+", text.casefold())


def stem(word: str) -> str:
    """The word without its ending: ``spins`` and ``spinning`` are one."""
    for ending in _ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= _LEAST_STEM:
            word = word.removesuffix(ending)
            break
    if len(word) > _LEAST_STEM and word[-1] == word[-2]:
        word = word[:-1]
    return word[:-1] + "y" if word.endswith("i") else word


@cache
def _stems() -> tuple[frozenset[str], frozenset[str], frozenset[str]]:
    """Of objects, of motions, and of all words of captions."""
    words, camera = known_words(), [phrase for one in CAMERA_MOVES.values() for phrase in one]
    functions = _of(_FUNCTION_WORDS)
    # Of names in several words the last one is the object: tree of "fir tree".
    nouns = (noun.split()[-1] for noun in words["objects"])
    objects = _of((*nouns, *words["colours"], "nothing"))
    motions = _of((*words["motions"], *words["directions"])) - functions
    others = functions | _of((*words["objects"], *words["places"], *camera))
    return objects, motions, objects | motions | others


def _of(phrases: Iterable[str]) -> frozenset[str]:
    return frozenset(stem(word) for phrase in phrases for word in words_of(phrase))

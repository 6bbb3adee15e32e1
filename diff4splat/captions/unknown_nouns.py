"""Captions about objects that no vocabulary has: a word that names nothing stands for each.

A user's words are more than any list. Of an unknown one, colour and place in the sentence remain.
"""

import torch

from diff4splat.captions.phrasings import Choices, request
from diff4splat.captions.random_draws import draw, draw_number
from diff4splat.captions.vocabulary import DIRECTIONS

ONSETS = (
    *("b", "c", "d", "f", "g", "h", "j", "k", "l", "m", "n", "p", "r", "s", "t", "v", "w", "z"),
    *("bl", "br", "ch", "cl", "cr", "dr", "fl", "fr", "gl", "gr", "pl", "pr", "qu", "sh", "sk"),
    *("sl", "sn", "sp", "st", "str", "th", "tr", "tw", "wh"),
)
VOWELS = ("a", "e", "i", "o", "u", "y", "ai", "ea", "ee", "oa", "oo", "ou")
ENDINGS = (
    *("", "b", "d", "g", "k", "l", "m", "n", "p", "r", "s", "t", "x", "ck", "ll", "nd", "ng"),
    *("nk", "nt", "rd", "rk", "rn", "sh", "st"),
)
SECOND_ENDINGS = ("le", "er", "el", "in", "on", "ey", "et", "illar", "mill", "pot")


def draw_unknown_noun(generator: torch.Generator) -> str:
    """One or two syllables that English could have: ``plound``, ``stoober``."""
    word = draw(ONSETS, generator) + draw(VOWELS, generator) + draw(ENDINGS, generator)
    return word + draw(SECOND_ENDINGS, generator) if draw_number(generator) % 2 else word


def with_unknown_words(sentence: str, generator: torch.Generator) -> str:
    """A sentence after, or before, one to four words that mean nothing."""
    count = 1 + draw_number(generator) % 4
    words = " ".join(draw_unknown_noun(generator) for _ in range(count))
    return f"{words} {sentence}" if draw_number(generator) % 2 else f"{sentence} {words}"


def caption_of_unknown_noun(color: str, generator: torch.Generator) -> str:
    """A sentence in which an object of ``color``, or of none, moves to one side."""
    name = f"{color} {draw_unknown_noun(generator)}".strip()
    choices = Choices(draw_number(generator))
    return request(name, draw(tuple(DIRECTIONS), generator), choices)

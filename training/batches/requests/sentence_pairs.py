"""A plain sentence and a free one that say the same: one object moves to one side."""

from dataclasses import dataclass

import torch

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.random_draws import draw, draw_share
from diff4splat.captions.requests import caption_of_object, plain_caption
from diff4splat.captions.unknown_nouns import with_unknown_words
from diff4splat.captions.vocabulary import DIRECTIONS
from diff4splat.training.batches.requests.present import TRAINING_NOUNS

UNKNOWN_WORDS_SHARE = 0.4
"""Templates are few: what a user writes around a request should not turn its side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SentencePair:
    """Two sentences of one meaning."""

    plain: str
    """``the red ball moves to the left``: the first phrase of ``DIRECTIONS`` for each side."""
    free: str
    """In any training phrasing, with synonyms, without the noun or the colour, or plain; some
    beside words that mean nothing."""


def draw_sentence_pair(generator: torch.Generator) -> SentencePair:
    """An object and a side at random; no image is needed."""
    named = NamedObject(draw(COLOR_NAMES, generator), draw(TRAINING_NOUNS, generator))
    direction = draw(tuple(DIRECTIONS), generator)
    free = caption_of_object([named], 0, direction, generator)
    if draw_share(generator) < UNKNOWN_WORDS_SHARE:
        free = with_unknown_words(free, generator)
    return SentencePair(plain=plain_caption(named, direction), free=free)

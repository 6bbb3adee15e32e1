"""A plain sentence and a free one that say the same: one object moves to one side."""

from dataclasses import dataclass

import torch

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.random_draws import draw
from diff4splat.captions.requests import caption_of_object, plain_caption
from diff4splat.captions.vocabulary import DIRECTIONS
from diff4splat.training.batches.requests.present import TRAINING_NOUNS


@dataclass(frozen=True, slots=True, kw_only=True)
class SentencePair:
    """Two sentences of one meaning."""

    plain: str
    """``the red ball moves to the left``: the first phrase of ``DIRECTIONS`` for each side."""
    free: str
    """In any training phrasing, with synonyms, without the noun or the colour, or plain."""


def draw_sentence_pair(generator: torch.Generator) -> SentencePair:
    """An object and a side at random; no image is needed."""
    named = NamedObject(draw(COLOR_NAMES, generator), draw(TRAINING_NOUNS, generator))
    direction = draw(tuple(DIRECTIONS), generator)
    return SentencePair(
        plain=plain_caption(named, direction),
        free=caption_of_object([named], 0, direction, generator),
    )

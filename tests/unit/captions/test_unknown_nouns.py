"""Words that name nothing: many, and none of the vocabulary."""

import torch

from diff4splat.captions.known_words import read_prompt
from diff4splat.captions.unknown_nouns import caption_of_unknown_noun, draw_unknown_noun


def test_unknown_nouns_are_many() -> None:
    generator = torch.Generator().manual_seed(0)
    drawn = {draw_unknown_noun(generator) for _ in range(500)}
    assert len(drawn) > 450 and all(len(word) >= 2 for word in drawn)


def test_captions_of_unknown_nouns_name_only_a_colour() -> None:
    generator = torch.Generator().manual_seed(0)
    for color in ("red", "") * 40:
        words = read_prompt(caption_of_unknown_noun(color, generator))
        found = set(words.objects) - {"can"}  # a verb here, a noun in the vocabulary
        assert found == ({color} if color else set()) and words.motions

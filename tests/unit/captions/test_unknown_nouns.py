"""Words that name nothing: many, and none of the vocabulary."""

import torch

from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.captions.known_words import read_prompt
from diff4splat.captions.other_nouns import OTHER_NOUNS
from diff4splat.captions.synonyms import may_be_confused
from diff4splat.captions.unknown_nouns import (
    caption_of_unknown_noun,
    draw_empty_word,
    draw_unknown_noun,
)


def test_words_that_name_nothing_are_many() -> None:
    generator = torch.Generator().manual_seed(0)
    drawn = {draw_empty_word(generator) for _ in range(500)}
    assert len(drawn) > 450 and all(len(word) >= 2 for word in drawn)


def test_half_of_the_unknown_nouns_are_english() -> None:
    generator = torch.Generator().manual_seed(0)
    drawn = [draw_unknown_noun(generator) for _ in range(500)]
    english = sum(word in OTHER_NOUNS for word in drawn)
    assert 200 < english < 300


def test_other_nouns_are_names_of_no_known_object() -> None:
    assert len(set(OTHER_NOUNS)) == len(OTHER_NOUNS) > 500
    for noun in OTHER_NOUNS:
        assert not [known for known in ALL_NOUNS if may_be_confused(noun, known)], noun
        assert not read_prompt(f"the {noun}").objects, noun


def test_captions_of_unknown_nouns_name_only_a_colour() -> None:
    generator = torch.Generator().manual_seed(0)
    for color in ("red", "") * 40:
        words = read_prompt(caption_of_unknown_noun(color, generator))
        found = set(words.objects) - {"can"}  # a verb here, a noun in the vocabulary
        assert found == ({color} if color else set()) and words.motions

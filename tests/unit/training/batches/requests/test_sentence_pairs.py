"""Two sentences of one meaning: the free one names the same object and side."""

import torch

from diff4splat.captions.phrasings import VALIDATION
from diff4splat.captions.synonyms import COLOR_SYNONYMS, SIDES, names
from diff4splat.captions.vocabulary import DIRECTIONS
from diff4splat.training.batches.requests.present import TRAINING_NOUNS
from diff4splat.training.batches.requests.sentence_pairs import SentencePair, draw_sentence_pair


def drawn(count: int = 300) -> list[SentencePair]:
    generator = torch.Generator().manual_seed(0)
    return [draw_sentence_pair(generator) for _ in range(count)]


def _side(sentence: str) -> str:
    return next(side for side, phrase in DIRECTIONS.items() if sentence.endswith(f" {phrase}"))


def test_both_name_one_side() -> None:
    seen = set()
    for pair in drawn():
        side = _side(pair.plain)
        assert any(phrase in pair.free for phrase in SIDES[side]), pair
        seen.add(side)
    assert seen == set(DIRECTIONS)


def test_every_side_is_asked_for_alike() -> None:
    sides = [_side(pair.plain) for pair in drawn()]
    assert all(0.18 < sides.count(side) / len(sides) < 0.32 for side in DIRECTIONS)


def test_both_name_one_object() -> None:
    for pair in drawn():
        name = pair.plain.removeprefix("the ").partition(" moves ")[0]
        color, _, noun = name.partition(" ")
        colors = (color, *COLOR_SYNONYMS.get(color, ()))
        assert noun in TRAINING_NOUNS
        assert any(word in pair.free for word in (*names(noun), *colors)), pair


def test_free_sentences_are_many_and_in_no_phrasing_of_validation() -> None:
    pairs = drawn()
    assert len({pair.free for pair in pairs}) > 250
    starts = [template.partition(" {")[0] for template in VALIDATION]
    kept_back = [start for start in starts if len(start.split()) > 2]
    assert kept_back
    assert not any(pair.free.startswith(start) for pair in pairs for start in kept_back)
    assert 0.05 < sum(pair.free == pair.plain for pair in pairs) / len(pairs) < 0.4


def test_some_free_sentences_stand_beside_words_that_mean_nothing() -> None:
    beside = [pair for pair in drawn() if pair.plain in pair.free and pair.plain != pair.free]
    assert any(pair.free.startswith(pair.plain) for pair in beside)
    assert any(pair.free.endswith(pair.plain) for pair in beside)
    added = [len(pair.free.split()) - len(pair.plain.split()) for pair in beside]
    assert set(added) == {1, 2, 3, 4}

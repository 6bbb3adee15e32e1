"""Captions have words for everything that worlds contain."""

from diff4splat.captions.vocabulary import NOUNS, PLACES, UNNAMED, VERBS
from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES


def test_every_kind_of_scene_has_a_phrase() -> None:
    assert list(PLACES) == list(SCENE_KINDS)


def test_every_motion_has_verbs() -> None:
    assert VERBS.keys() == MOTIONS.keys()


def test_the_nouns_are_those_of_the_families() -> None:
    assert tuple(sorted({family.noun for family in FAMILIES.values()} - {UNNAMED})) == NOUNS

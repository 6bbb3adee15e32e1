"""Random shapes: closed, of many forms, and only where a recipe asks for them."""

import numpy as np
import pytest

from diff4splat.captions.grammar import parse_caption
from diff4splat.captions.vocabulary import NOUNS, UNNAMED
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.families.composites import PRIMITIVES, make_composite
from diff4splat.data_prep.synthetic.shapes.registry import COMPOSITE
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import signed_volume
from diff4splat.data_prep.synthetic.splits import load_split
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError

SMALL = {"frames": 3, "views": 1, "size_px": (32, 32), "still_share": 0.0}


@pytest.mark.parametrize("make", PRIMITIVES)
def test_primitives_are_closed_and_have_a_volume(make) -> None:
    for seed in range(20):
        assert signed_volume(make(Rng("primitive", seed))) > 0


def test_many_draws_are_well_made() -> None:
    for seed in range(60):
        shape = make_composite(Rng("composite", seed))
        assert shape.height == pytest.approx(1.0) and shape.triangles < 5000
        assert 0.15 < shape.radius < 5
        for part in shape.parts:
            assert np.isfinite(part.surface.vertices).all() and np.isfinite(part.surface.uv).all()
            assert signed_volume(part.surface) > 0


def test_draws_differ_in_proportions_and_materials() -> None:
    shapes = [make_composite(Rng("variety", seed)) for seed in range(60)]
    radii = np.array([shape.radius for shape in shapes])
    assert np.ptp(np.log(radii)) > np.log(2)
    assert {len(shape.parts) for shape in shapes} == {1, 2}
    assert len({shape.parts[0].role for shape in shapes}) > 5


def test_the_share_of_a_draw_is_that_of_the_split() -> None:
    split = WorldRecipe(composite_share=0.4).allowed()
    drawn = [split.draw_family(("ball", "box"), Rng("draw", n)) for n in range(400)]
    assert drawn.count(COMPOSITE) / 400 == pytest.approx(0.4, abs=0.08)
    assert {"ball", "box"} <= set(drawn)


def test_no_split_has_composites_of_its_own() -> None:
    for name in ("training", "held_out"):
        split = load_split(name)
        assert COMPOSITE not in split.families.names
        drawn = [split.draw_family(("ball", "box"), Rng("draw", n)) for n in range(60)]
        plain = [Rng("draw", n).choice(("ball", "box")) for n in range(60)]
        assert drawn == plain


def _names(index: int, **settings) -> set[str]:
    recipe = WorldRecipe(seed=3, composite_share=1.0, **{**SMALL, **settings})
    return {note.name for note in make_world(recipe, index).note.objects}


def test_composites_move_in_worlds_with_captions_that_parse() -> None:
    moving = set()
    for index in range(6):
        note = make_world(WorldRecipe(seed=3, composite_share=1.0, **SMALL), index).note
        moving |= {one.name for one in note.objects if one.motion}
        assert parse_caption(note.caption).events
    assert UNNAMED in moving


def test_static_objects_of_worlds_are_composites_too() -> None:
    assert any(UNNAMED in _names(index, still_share=1.0) for index in range(4))


def test_arrangements_of_composites_have_no_other_objects() -> None:
    names = set().union(*(_names(index, arrangements=True) for index in range(6)))
    assert UNNAMED in names and not names & set(NOUNS)


def test_worlds_say_that_they_have_composites() -> None:
    made = make_world(WorldRecipe(seed=3, composite_share=0.25, **SMALL), 0)
    assert made.note.identifier.endswith("-composite25")


def test_a_share_above_one_is_refused() -> None:
    with pytest.raises(ConfigError, match="composite_share"):
        WorldRecipe(composite_share=1.5)

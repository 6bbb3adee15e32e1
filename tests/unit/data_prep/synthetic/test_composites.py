"""Random shapes: closed, of many forms, and only where a recipe asks for them."""

import numpy as np
import pytest

from diff4splat.captions.grammar import parse_caption
from diff4splat.captions.vocabulary import NOUNS, UNNAMED
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.families import composites
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


def _on_axis(surface) -> np.ndarray:
    """Heights at which the body meets its axis."""
    vertices = surface.vertices
    return -vertices[np.linalg.norm(vertices[:, [0, 2]], axis=1) < 0.2, 1]


def test_pipes_are_open_at_both_ends_and_vessels_at_the_top() -> None:
    for seed in range(20):
        assert len(_on_axis(composites._pipe(Rng("pipe", seed)))) == 0
        meets = _on_axis(composites._vessel(Rng("vessel", seed)))
        assert meets.min() == pytest.approx(0.0, abs=1e-9) and 0.0 < meets.max() <= 0.5


def test_walls_of_hollow_bodies_have_a_volume_without_crossing() -> None:
    for seed in range(20):
        for make in (composites._pipe, composites._vessel):
            piece = make(Rng("wall", seed))
            low, high = piece.vertices.min(0), piece.vertices.max(0)
            solid = np.pi / 4 * np.prod(high - low)
            assert 0.0 < signed_volume(piece) < 0.75 * solid


def test_some_pieces_are_thin() -> None:
    pieces = [composites._piece(composites.FIRST_SIZES, Rng("thin", seed)) for seed in range(200)]
    # The smallest singular value of a cloud of corners is small where the piece is a sheet.
    spans = [np.linalg.svd(piece.vertices - piece.vertices.mean(0))[1] for piece in pieces]
    thin = np.array([span[2] < 0.2 * span[0] for span in spans])
    assert 0.08 < thin.mean() < 0.35


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

"""People: well-made figures, most of them upright, and only where a recipe asks for them."""

import math

import numpy as np
import pytest

from diff4splat.captions.vocabulary import NOUNS
from diff4splat.data_prep.synthetic.arrangements.backdrops import make_backdrop
from diff4splat.data_prep.synthetic.arrangements.cameras import FACED_TILT_DEG, any_view
from diff4splat.data_prep.synthetic.arrangements.objects import arrange
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.families.people import make_person
from diff4splat.data_prep.synthetic.shapes.registry import COMPOSITE, PERSON
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import signed_volume
from diff4splat.data_prep.synthetic.splits import load_split
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import ConfigError

SMALL = {"frames": 1, "views": 2, "size_px": (32, 32), "arrangements": True}


def test_figures_are_closed_pieces_of_height_one() -> None:
    for seed in range(40):
        shape = make_person(Rng("figure", seed))
        assert shape.height == pytest.approx(1.0) and shape.triangles < 5000
        for part in shape.parts:
            assert np.isfinite(part.surface.vertices).all() and signed_volume(part.surface) > 0


def test_a_head_is_above_the_body_and_hands_are_beside_it() -> None:
    for seed in range(20):
        clothes, skin, hair = make_person(Rng("order", seed)).parts[:3]
        assert skin.surface.vertices[:, 1].min() < clothes.surface.vertices[:, 1].min()
        assert hair.surface.vertices[:, 1].min() < clothes.surface.vertices[:, 1].min()
        wide = [np.ptp(part.surface.vertices[:, 2]) for part in (clothes, hair)]
        assert wide[0] > wide[1]


def test_figures_differ_in_clothes_and_some_are_cut_at_the_hips() -> None:
    shapes = [make_person(Rng("variety", seed)) for seed in range(60)]
    assert len({shape.parts[0].role for shape in shapes}) > 3
    wide = np.array([np.ptp(shape.bounds, axis=0)[2] for shape in shapes])
    # A half is twice as wide for its height.
    assert 0.3 < (wide > 0.6).mean() < 0.9


def test_the_share_is_that_of_what_is_no_composite() -> None:
    split = WorldRecipe(person_share=0.5, composite_share=0.4).allowed()
    drawn = [split.draw_family(("ball", "box"), Rng("draw", n)) for n in range(600)]
    assert drawn.count(COMPOSITE) / 600 == pytest.approx(0.4, abs=0.07)
    assert drawn.count(PERSON) / 600 == pytest.approx(0.3, abs=0.07)


def test_no_split_has_people_of_its_own() -> None:
    for name in ("training", "held_out"):
        split = load_split(name)
        assert PERSON not in split.families.names
        drawn = [split.draw_family(("ball", "box"), Rng("draw", n)) for n in range(60)]
        assert drawn == [Rng("draw", n).choice(("ball", "box")) for n in range(60)]


def test_views_of_people_are_mostly_level_and_near() -> None:
    split = WorldRecipe(person_share=1.0, **SMALL).allowed()
    level = []
    for seed in range(40):
        people = arrange(split, Rng("people", seed), is_portrait=True, is_high=False)
        backdrop = make_backdrop("open", Rng("backdrop", seed))
        view = any_view(people, backdrop, Rng("view", seed), is_portrait=True)
        assert view is not None
        level.append(abs(math.degrees(view.roll_rad)) <= 6.0)
        assert math.degrees(view.tilt_rad) >= FACED_TILT_DEG[0]
    assert np.mean(level) > 0.65


def test_worlds_say_that_they_have_people_and_no_caption_names_them() -> None:
    made = make_world(WorldRecipe(seed=3, person_share=1.0, **SMALL), 0)
    assert made.note.identifier.endswith("-person100")
    assert not {note.name for note in made.note.objects} & set(NOUNS)


def test_a_share_above_one_is_refused() -> None:
    with pytest.raises(ConfigError, match="person_share"):
        WorldRecipe(person_share=1.5)

"""Windows of photographs against the whole."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from depth_stages import MODEL, depth_recipe, with_sky
from stage_fixtures import make_batch, make_stage, shake_heads
from torch import Tensor

from diff4splat.errors import ConfigError, InputError
from diff4splat.io.photos.images import write_png
from diff4splat.training.recipe.fingerprint import decisive, fingerprint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_dict
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.photo_windows import consistency_error, window_difference


def slope(rgb: Tensor) -> Tensor:
    """A depth that a window shows as the whole does: colour decides it."""
    return rgb.mean(1)


def ramp(count: int = 2, side: int = 32) -> Tensor:
    line = torch.linspace(0, 1, side)
    return (line[:, None] + line).expand(count, 3, -1, -1) / 2


def photo_recipe(folder: Path, **losses: float) -> StageRecipe:
    recipe = depth_recipe(window_consistency=0.5, **losses)
    data = replace(recipe.data, view_sides_px=(16, 32), photographs=str(folder))
    return replace(recipe, data=data)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for place in range(3):
        generator = torch.Generator().manual_seed(place)
        write_png(torch.rand(40, 56, 3, generator=generator), tmp_path / f"{place}.png")
    (tmp_path / "notes.txt").write_text("no photograph")
    return tmp_path


def test_depth_that_follows_the_surface_has_no_error_in_any_window() -> None:
    draws = torch.rand(2, 5, generator=torch.Generator().manual_seed(0))
    found = window_difference(slope, ramp(), (16, 24), draws, lambda rgb: rgb)
    assert found.shape == (2,) and float(found.max()) < 0.03


def test_depth_that_follows_the_row_of_each_image_has_an_error() -> None:
    def row(rgb: Tensor) -> Tensor:
        down = torch.linspace(0, 2, rgb.shape[2])[:, None]
        return down.expand(len(rgb), *rgb.shape[2:])

    draws = torch.rand(2, 5, generator=torch.Generator().manual_seed(0))
    found = window_difference(row, ramp(), (16, 24), draws, lambda rgb: rgb)
    assert float(found.min()) > 0.1


def test_a_window_is_never_the_whole() -> None:
    seen = []

    def keep(rgb: Tensor) -> Tensor:
        seen.append(rgb)
        return rgb

    window_difference(slope, ramp(1), (32, 32), torch.zeros(1, 5), keep)
    assert float(seen[0].max() - seen[0].min()) < 0.9 * float(ramp(1).max())


def test_the_unit_is_free_and_the_error_is_finite_far_out() -> None:
    depth = torch.rand(2, 8, 8, generator=torch.Generator().manual_seed(1))
    assert float(consistency_error(depth + 3, depth).max()) < 1e-5
    far = consistency_error(torch.full((1, 8, 8), 1e4), torch.full((1, 8, 8), -1e4))
    assert bool(far.isfinite().all())


def test_only_the_window_learns() -> None:
    calls = []

    def scaled(rgb: Tensor) -> Tensor:
        calls.append(torch.is_grad_enabled())
        return rgb.mean(1) * weight

    weight = torch.tensor(1.0, requires_grad=True)
    draws = torch.rand(2, 5, generator=torch.Generator().manual_seed(0))
    window_difference(scaled, ramp(), (16, 16), draws, lambda rgb: rgb**2).sum().backward()
    assert calls == [False, True]
    assert weight.grad is not None and float(weight.grad.abs()) > 0


def test_the_stage_adds_the_term_and_repeats_it_exactly(folder: Path) -> None:
    recipe = photo_recipe(folder)
    stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0, 1)))
    shake_heads(stage)
    assert stage.photographs.shape == (3, 3, 32, 32)
    terms = stage(batch)
    assert torch.equal(terms["window_consistency"], stage(batch)["window_consistency"])
    assert terms["window_consistency"].shape == (2,)
    without = make_stage(replace(recipe, losses=depth_recipe().losses), model=MODEL)
    assert "window_consistency" not in without(batch)
    terms[TOTAL].sum().backward()
    assert all(bool(p.grad.isfinite().all()) for p in stage.monocular_depth.parameters())


def test_windows_see_other_light_than_the_whole(folder: Path) -> None:
    recipe = photo_recipe(folder)
    stage, batch = make_stage(recipe, model=MODEL), make_batch(recipe, (0, 1))
    images, lights = stage._views(batch), []
    stage._random_colors = lambda rgb, batch, purpose="light": lights.append(purpose) or rgb
    stage._window_consistency(batch, images)
    assert lights == ["window light"]


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected photographs .*correct data\.photographs"):
        make_stage(photo_recipe(tmp_path), model=MODEL)


def test_the_weight_without_a_folder_is_refused(tmp_path: Path) -> None:
    recipe = photo_recipe(tmp_path)
    recipe = replace(recipe, data=replace(recipe.data, photographs=""))
    with pytest.raises(ConfigError, match=r"photographs: expected a folder"):
        Recipe(name="test", seed=0, model=MODEL, stages=(recipe,))


def test_earlier_runs_keep_their_fingerprint(tmp_path: Path) -> None:
    plain = Recipe(name="test", seed=0, model=MODEL, stages=(depth_recipe(),))
    moved = depth_recipe()
    moved = replace(moved, data=replace(moved.data, photographs=str(tmp_path)))
    other = Recipe(name="test", seed=0, model=MODEL, stages=(moved,))
    weighted = Recipe(name="test", seed=0, model=MODEL, stages=(photo_recipe(tmp_path),))
    one, two, three = (fingerprint(r, "monocular_depth") for r in (plain, other, weighted))
    assert one == two != three
    # The key is new: with it, runs from before would not go on.
    assert "window_consistency" not in decisive(recipe_to_dict(plain)["stages"][0])["losses"]

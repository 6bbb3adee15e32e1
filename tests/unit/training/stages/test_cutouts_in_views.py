"""Cutouts in the views that the depth network is trained with."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from depth_stages import MODEL, depth_recipe, with_sky
from stage_fixtures import make_batch, make_stage

from diff4splat.errors import ConfigError, InputError
from diff4splat.training.recipe.fingerprint import fingerprint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe


def cutout_recipe(folder: Path | str, sides: tuple[int, ...] = (32,)) -> StageRecipe:
    recipe = depth_recipe()
    return replace(recipe, data=replace(recipe.data, view_sides_px=sides, cutouts=str(folder)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((20, 20, 4), 255, np.uint8))
    return tmp_path


def test_some_views_show_one_and_a_step_repeats_exactly(folder: Path) -> None:
    recipe = cutout_recipe(folder)
    batch = with_sky(make_batch(recipe, tuple(range(8))))
    stage, plain = (make_stage(one, model=MODEL) for one in (recipe, cutout_recipe("")))
    views, again, without = stage._views(batch), stage._views(batch), plain._views(batch)
    assert torch.equal(views.rgb, again.rgb) and torch.equal(views.depth, again.depth)
    changed = (views.rgb != without.rgb).flatten(1).any(1)
    assert 0.1 < float(changed.float().mean()) < 0.7
    torch.testing.assert_close(views.depth[~changed], without.depth[~changed])


def test_a_folder_without_cutouts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected PNG or WebP images with transparency"):
        make_stage(cutout_recipe(tmp_path), model=MODEL)


def test_whole_images_cannot_show_them(folder: Path) -> None:
    stage = cutout_recipe(folder, sides=())
    with pytest.raises(ConfigError, match=r"view_sides_px: expected sides of views that show"):
        Recipe(name="test", seed=0, model=MODEL, stages=(stage,))


def test_runs_with_them_are_other_runs(folder: Path) -> None:
    with_them, without, before = (
        Recipe(name="test", seed=0, model=MODEL, stages=(stage,))
        for stage in (cutout_recipe(folder), cutout_recipe(""), cutout_recipe(""))
    )
    one, two, three = (fingerprint(r, "monocular_depth") for r in (with_them, without, before))
    assert one != two == three

"""The stage that trains the depth of single images."""

import math
from dataclasses import replace

import pytest
import torch
from depth_stages import MODEL, depth_recipe, with_sky
from stage_fixtures import make_batch, make_stage, shake_heads
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import MonocularDepthConfig
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.recipe.fingerprint import decisive, fingerprint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_dict
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.kinds import monocular_depth
from diff4splat.training.stages.kinds.monocular_depth import SKY_DEPTH, batch_images


def test_every_key_frame_and_target_is_an_image() -> None:
    recipe = depth_recipe()
    batch = with_sky(make_batch(recipe, (0, 1)))
    shown = batch_images(batch)
    each = batch.depth.shape[1] + batch.target_rgb[0, :, :, 0, 0, 0].numel()
    assert len(shown.rgb) == len(shown.depth) == 2 * each
    assert not shown.known[:, :8].any() and bool((shown.depth[:, :8] == 1).all())
    for depth, known in zip(shown.depth, shown.known, strict=True):
        assert float(depth[known].median()) == pytest.approx(PLANE_DEPTH, rel=1e-5)
    first = batch.video[1, 0].movedim(-1, 0) / 255
    torch.testing.assert_close(shown.rgb[each], first.float())


def test_terms_are_finite_and_only_the_images_depth_learns() -> None:
    recipe = depth_recipe()
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    terms = stage(with_sky(make_batch(recipe, (0, 1))))
    assert set(terms) == {"depth_log", "depth_gradient", "inverse_depth", "sky_margin", TOTAL}
    assert all(term.shape == (2,) and bool(term.isfinite().all()) for term in terms.values())
    terms[TOTAL].sum().backward()
    learnt = {name for name, p in stage.named_parameters() if p.grad is not None}
    assert learnt and all(name.startswith("monocular_depth.") for name in learnt)


def test_the_total_is_the_weighted_sum() -> None:
    recipe = depth_recipe(depth_log=2.0, depth_gradient=3.0, inverse_depth=7.0, sky_margin=5.0)
    terms = make_stage(recipe, model=MODEL)(with_sky(make_batch(recipe, (0,))))
    wanted = 2 * terms["depth_log"] + 3 * terms["depth_gradient"] + 5 * terms["sky_margin"]
    torch.testing.assert_close(terms[TOTAL], wanted + 7 * terms["inverse_depth"])


def test_the_shift_is_that_of_inverse_depths_where_they_are_known() -> None:
    recipe = depth_recipe()
    batch = with_sky(make_batch(recipe, (0,)))
    shown = batch_images(batch)
    # A fresh network puts everything on the plane.
    off = (1 - PLANE_DEPTH / shown.depth).abs()
    wanted = torch.stack([one[known].mean() for one, known in zip(off, shown.known, strict=True)])
    found = make_stage(recipe, model=MODEL)(batch)["inverse_depth"]
    torch.testing.assert_close(found, wanted.mean()[None])


def test_sky_that_is_far_enough_costs_nothing() -> None:
    recipe = depth_recipe()
    stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0,)))
    near = float(stage(batch)["sky_margin"].detach())
    assert near == pytest.approx(float(torch.tensor(SKY_DEPTH / PLANE_DEPTH).log()), rel=1e-4)
    with torch.no_grad():
        stage.monocular_depth.head.bias += 10
    assert float(stage(batch)["sky_margin"].detach()) == 0


def test_without_any_depth_there_is_nothing_to_learn() -> None:
    recipe = depth_recipe()
    batch = make_batch(recipe, (0,))
    empty = replace(
        batch,
        depth=torch.zeros_like(batch.depth),
        target_depth=torch.zeros_like(batch.target_depth),
    )
    stage = make_stage(recipe, model=MODEL)
    terms = {name: float(term.detach()) for name, term in stage(empty).items()}
    assert terms["depth_log"] == terms["depth_gradient"] == terms["inverse_depth"] == 0
    assert terms["sky_margin"] == 0  # nothing tells sky from the rest
    measures = stage.eval().measure(empty)
    assert bool(measures["depth_error"].isnan()) and bool(measures["depth_correlation"].isnan())


def test_light_is_drawn_anew_for_every_image_and_alike_every_time() -> None:
    recipe = depth_recipe()
    stage, batch = make_stage(recipe, model=MODEL), make_batch(recipe, (0, 1))
    count = len(batch_images(batch).rgb)
    rgb = torch.rand(1, 3, 8, 8).expand(count, -1, -1, -1)
    lit = stage._random_colors(rgb, batch)
    assert torch.equal(lit, stage._random_colors(rgb, batch))
    assert float(lit.min()) >= 0 and float(lit.max()) <= 1
    assert len(lit.flatten(1).unique(dim=0)) == count


def test_a_step_learns_and_a_panel_shows_it() -> None:
    recipe = depth_recipe()
    stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0, 1)))
    optimizer = torch.optim.Adam(stage.monocular_depth.parameters(), 1e-2)
    losses = []
    for _ in range(12):
        optimizer.zero_grad()
        loss = stage(batch)[TOTAL].mean()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.9 * losses[0]
    shown = stage.eval().panel(batch)
    assert bool(shown.isfinite().all()) and shown.shape[-1] == 3
    assert set(stage.measure(batch)) == {"depth_error", "depth_correlation"}


def test_the_depth_network_is_the_only_part() -> None:
    stage = make_stage(depth_recipe(), model=MODEL)
    assert [name for name, _ in stage.named_children()] == ["monocular_depth"]


def test_a_recipe_without_the_network_is_refused() -> None:
    without = replace(MODEL, monocular_depth=MonocularDepthConfig())
    with pytest.raises(ConfigError, match=r"monocular_depth\.channels: expected a depth network"):
        Recipe(name="test", seed=0, model=without, stages=(depth_recipe(),))


def test_random_views_have_sides_of_the_recipe_and_repeat_exactly() -> None:
    recipe = depth_recipe()
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=(16, 32)))
    stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0, 1)))
    shake_heads(stage)
    views, again = stage._views(batch), stage._views(batch)
    assert set(views.rgb.shape[2:]) <= {16, 32} and len(views.rgb) == len(batch_images(batch).rgb)
    assert torch.equal(views.rgb, again.rgb) and torch.equal(views.depth, again.depth)
    terms = stage(batch)
    assert all(bool(term.isfinite().all()) for term in terms.values())


def test_random_views_have_other_skies_before_they_become_photos(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recipe = depth_recipe()
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=(32,)))
    stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0, 1)))
    seen = []

    def white(rgb: Tensor, known: Tensor, draws: Tensor) -> Tensor:
        seen.append(known)
        return torch.ones_like(rgb)

    monkeypatch.setattr(monocular_depth, "random_sky", white)
    monkeypatch.setattr(monocular_depth, "random_photo", lambda rgb, draws, noise: rgb)
    views = stage._views(batch)
    assert bool((views.rgb == 1).all()) and torch.equal(seen[0], views.known)


@pytest.mark.parametrize("sides", [(0,), (24,), (-16,)])
def test_sides_that_the_network_cannot_take_are_refused(sides: tuple[int, ...]) -> None:
    data = depth_recipe().data
    with pytest.raises(ConfigError, match=r"view_sides_px: expected multiples of 16"):
        replace(data, view_sides_px=sides)


UNSURE = replace(
    MODEL,
    monocular_depth=MonocularDepthConfig(channels=4, image_backbone=True, uncertainty=True),
)


def test_uncertainty_is_learnt_beside_depth_or_alone() -> None:
    recipe = depth_recipe(uncertainty=0.5)
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=(32,)))
    stage, batch = make_stage(recipe, model=UNSURE), with_sky(make_batch(recipe, (0, 1)))
    shake_heads(stage)
    terms = stage(batch)
    assert terms["uncertainty"].shape == (2,) and bool(terms["uncertainty"].isfinite().all())
    assert terms["depth_log"].shape == (2,)
    none = {"depth_log": 0.0, "depth_gradient": 0.0, "inverse_depth": 0.0, "sky_margin": 0.0}
    alone = replace(recipe, losses=depth_recipe(uncertainty=1.0, **none).losses)
    stage = make_stage(alone, model=UNSURE)
    terms = stage(batch)
    assert set(terms) == {"uncertainty", TOTAL}
    terms[TOTAL].sum().backward()
    learnt = {name for name, one in stage.named_parameters() if one.grad is not None}
    assert learnt and all(name.startswith("monocular_depth.uncertainty.") for name in learnt)


def test_the_scale_divides_the_error() -> None:
    recipe = depth_recipe(uncertainty=1.0)
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=(32,)))
    stage, batch = make_stage(recipe, model=UNSURE), with_sky(make_batch(recipe, (0, 1)))
    bias, errors = stage.monocular_depth.uncertainty.head.bias, []
    for log_scale in (1.0, -1.0):
        torch.nn.init.constant_(bias, log_scale)
        term = stage(batch)["uncertainty"].detach()
        errors.append((term - log_scale) * math.exp(log_scale))
    torch.testing.assert_close(*errors)
    assert bool((errors[0] > 0.01).all())


def test_its_weight_without_the_head_is_refused() -> None:
    recipe = depth_recipe(uncertainty=1.0)
    with pytest.raises(ConfigError, match=r"monocular_depth\.uncertainty: expected true for its"):
        Recipe(name="r", seed=0, model=MODEL, stages=(recipe,))


def test_runs_from_before_uncertainty_go_on() -> None:
    recipe = Recipe(name="r", seed=0, model=MODEL, stages=(depth_recipe(),))
    assert "uncertainty" not in decisive(recipe_to_dict(recipe)["stages"][0])["losses"]
    unsure = Recipe(name="r", seed=0, model=UNSURE, stages=(depth_recipe(uncertainty=1.0),))
    name = "monocular_depth"
    assert fingerprint(recipe, name) != fingerprint(unsure, name)

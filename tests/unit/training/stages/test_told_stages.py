"""Stages around the motion that is told: the reconstruction, the branch that tells, and both."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import DetailConfig, ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.render.api import render
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.recipe import Recipe, StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import network_rays
from diff4splat.training.stages.prediction import canonical_scenes, first_picture
from diff4splat.training.stages.told import matched

DETAIL = DetailConfig(width=6, match_channels=4, depths=4, surroundings=4)
BASE = tiny_size()
MODEL: ModelConfig = replace(
    BASE, detail=DETAIL, dit=replace(BASE.dit, motion=True, motion_width=8)
)
TOLD, BRANCH, GENERATED = "told", "branch", "generated"
TRAINED = {TOLD: ("ldrm",), BRANCH: ("dit",), GENERATED: ("ldrm",)}
TERMS = {
    TOLD: {"photometric", "perceptual", "depth", "smoothness", "depth_log", TOTAL},
    BRANCH: {"flow", "moves", TOTAL},
}
TERMS[GENERATED] = TERMS[TOLD]


def told(kind: str) -> StageRecipe:
    like = stage_recipe("generator" if kind == BRANCH else "dynamic", depth_log=1.0, moves=0.5)
    data = replace(like.data, track_stride=4)
    return replace(like, name=kind, kind=kind, data=data, trained=TRAINED[kind], single_share=1.0)


def moving_batch(recipe: StageRecipe, indices: tuple[int, ...] = (0, 1)) -> ClipBatch:
    """Clips of which one half goes to the right."""
    batch = make_batch(recipe, indices)
    field, moving = torch.zeros_like(batch.field), torch.zeros_like(batch.moving)
    field[:, 0, 1:] = 2.0
    field[:, 1, 1:, :, : field.shape[-1] // 2] = 1.0
    moving[:, :, : moving.shape[-1] // 2] = True
    return replace(batch, field=field, moving=moving)


@pytest.mark.parametrize("kind", TRAINED)
def test_terms_and_gradients_are_finite_and_reach_what_learns(kind: str) -> None:
    recipe = told(kind)
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    terms = stage(moving_batch(recipe))
    assert set(terms) == TERMS[kind]
    terms[TOTAL].sum().backward()
    for part in stage.parts:
        gradients = [p.grad for p in getattr(stage, part).parameters() if p.grad is not None]
        assert bool(gradients) == (part in recipe.trained), part
        assert all(bool(gradient.isfinite().all()) for gradient in gradients)


def test_the_depth_of_pictures_is_used_and_left_as_it_is() -> None:
    recipe = told(TOLD)
    model = replace(MODEL, detail=replace(DETAIL, picture_width=4))
    stage = make_stage(recipe, model=model)
    shake_heads(stage)
    batch = moving_batch(recipe)
    before = stage(batch)[TOTAL].detach()
    stage(batch)[TOTAL].sum().backward()
    learnt = {name for name, p in stage.ldrm.named_parameters() if p.grad is not None}
    assert learnt and not any("picture_depth" in name for name in learnt)
    with torch.no_grad():
        stage.ldrm.detail.picture_depth.head.bias += 1
    assert not torch.equal(stage(batch)[TOTAL].detach(), before)


def test_the_branch_learns_and_nothing_else_of_the_video_model() -> None:
    recipe = told(BRANCH)
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    stage(moving_batch(recipe))[TOTAL].sum().backward()
    learnt = {name for name, p in stage.dit.named_parameters() if p.grad is not None}
    assert learnt
    assert all(name.startswith("motion_branch.") for name in learnt)


def test_both_learn_where_the_branch_is_trained_too() -> None:
    recipe = replace(told(GENERATED), trained=("dit", "ldrm"))
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    assert set(stage(moving_batch(recipe))) == TERMS[TOLD] | TERMS[BRANCH]


def test_told_scenes_move_with_the_motion_of_the_batch() -> None:
    recipe = told(TOLD)
    stage = make_stage(recipe, model=MODEL).eval()
    moving = moving_batch(recipe)
    moving = replace(moving, target_time=torch.ones_like(moving.target_time))
    still = replace(moving, moving=torch.zeros_like(moving.moving))
    with torch.no_grad():
        seen = [
            stage.render(stage.given(b), stage.encode(stage.given(b))).rgb for b in (moving, still)
        ]
    assert not torch.allclose(*seen, atol=1e-3)
    at_first = replace(moving, target_time=torch.zeros_like(moving.target_time))
    with torch.no_grad():
        first = stage.render(stage.given(at_first), stage.encode(stage.given(at_first))).rgb
    torch.testing.assert_close(first, seen[1])


def test_what_is_judged_has_the_colours_that_generation_would_match() -> None:
    recipe = told(TOLD)
    stage = make_stage(recipe, model=MODEL).eval()
    batch = stage.given(moving_batch(recipe, (0,)))
    latent = stage.encode(batch)
    sight = stage.sight(batch, latent)
    maps = stage.ldrm(latent, network_rays(batch), sight, moving=False)
    picture = first_picture(batch, 0)
    plain = canonical_scenes(maps, batch, MODEL, sight)[0]
    errors = [
        float((render(seen, picture.camera).rgb - picture.rgb).square().mean().detach())
        for seen in (plain.gaussians, matched(plain, picture))
    ]
    assert errors[1] < 0.7 * errors[0]


def test_some_steps_see_the_whole_video() -> None:
    recipe = replace(told(TOLD), single_share=0.0)
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    batch = moving_batch(recipe)
    assert stage.given(batch).video.shape[1] == recipe.data.frames
    assert "motion" in stage(batch)
    assert stage.eval().given(batch).video.shape[1] == 1


def test_mirrors_exchange_pictures_motion_and_words() -> None:
    recipe = told(BRANCH)
    stage = make_stage(recipe, model=MODEL)
    batch = moving_batch(recipe, tuple(range(8)))
    batch = replace(batch, captions=("a red ball rolls to the left",) * 8)
    seen = stage._seen_in_mirrors(batch)
    turned = [caption.endswith("right") for caption in seen.captions]
    assert 0 < sum(turned) < 8
    for index, other in enumerate(turned):
        video = batch.video[index].flip(-2) if other else batch.video[index]
        assert torch.equal(seen.video[index], video)
        sign = -1 if other else 1
        assert float(seen.field[index, 0].sum()) == sign * float(batch.field[index, 0].sum())
        columns = seen.field[index, 1].abs().sum((0, 1)) > 0
        assert bool(columns[-1]) == bool(seen.moving[index, :, -1].all()) == other


def test_a_fresh_branch_guesses_that_everything_stands() -> None:
    recipe = told(BRANCH)
    stage = make_stage(recipe, model=MODEL).eval()
    batch = moving_batch(recipe)
    torch.testing.assert_close(stage.measure(batch)["motion_share"], torch.ones(2))
    still = replace(batch, field=torch.zeros_like(batch.field))
    assert bool(stage.measure(still)["motion_share"].isnan().all())


@pytest.mark.parametrize("kind", TRAINED)
def test_panels_and_measures(kind: str) -> None:
    recipe = told(kind)
    stage = make_stage(recipe, model=MODEL).eval()
    batch = moving_batch(recipe)
    picture = stage.panel(batch)
    assert picture.ndim == 3 and bool(picture.isfinite().all())
    measures = stage.measure(batch)
    assert ("psnr" in measures) == (kind != BRANCH)
    assert ("flow_error" in measures) == (kind != TOLD)


def test_a_detour_from_nowhere_is_the_motion_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = told(GENERATED)
    stage = make_stage(recipe, model=MODEL).eval()
    batch = moving_batch(recipe)
    monkeypatch.setattr(torch, "rand", lambda *size, **options: torch.zeros(*size))
    made = stage.regenerated(batch)
    torch.testing.assert_close(made.field, batch.field)
    # A fresh branch is undecided about everything, which is likely enough to move.
    assert made.moving.all()


def test_kinds_that_ask_the_branch_need_one() -> None:
    recipe = told(BRANCH)
    without = replace(MODEL, dit=replace(MODEL.dit, motion_width=0))
    with pytest.raises(ConfigError, match="motion_width: expected a motion branch"):
        Recipe(name="x", seed=0, model=without, stages=(recipe,))

"""The stage that trains the motion network: what learns, the random flip, and what is measured."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig, MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.recipe.fingerprint import fingerprint_of
from diff4splat.training.recipe.losses import MotionDiffusionLosses
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_dict
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.kinds.motion_diffusion import _cell_weights

BASE = tiny_size()
MODEL: ModelConfig = replace(BASE, motion_unet=MotionUNetConfig(width=16, heads=2))


def motion_recipe() -> StageRecipe:
    return replace(
        stage_recipe("video_diffusion"),
        name="motion_diffusion",
        kind="motion_diffusion",
        trained=("motion_unet",),
        losses=MotionDiffusionLosses(motion_mask=0.5),
    )


def moving_batch(recipe: StageRecipe, indices: tuple[int, ...] = (0, 1)) -> ClipBatch:
    """Clips of which one half moves to the right."""
    batch = make_batch(recipe, indices)
    field, moving = torch.zeros_like(batch.field), torch.zeros_like(batch.moving)
    field[:, 0, 1:] = 2.0
    field[:, 1, 1:, :, : field.shape[-1] // 2] = 1.0
    moving[:, :, : moving.shape[-1] // 2] = True
    return replace(batch, field=field, moving=moving)


def test_terms_and_gradients_are_finite_and_only_the_motion_network_learns() -> None:
    recipe = motion_recipe()
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    terms = stage(moving_batch(recipe))
    assert set(terms) == {"flow", "motion_mask", TOTAL}
    terms[TOTAL].sum().backward()
    gradients = {name: p.grad for name, p in stage.named_parameters() if p.grad is not None}
    assert gradients and all(name.startswith("motion_unet.") for name in gradients)
    assert all(bool(gradient.isfinite().all()) for gradient in gradients.values())


def test_sentences_of_one_meaning_are_compared_where_the_recipe_says_so() -> None:
    recipe = replace(motion_recipe(), losses=MotionDiffusionLosses(paraphrase=1.0))
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    terms = stage(moving_batch(recipe))
    assert set(terms) == {"flow", "paraphrase", TOTAL}
    assert terms["paraphrase"].shape == (2,) and bool((terms["paraphrase"] > 0).all())
    alone = stage(moving_batch(recipe, (1,)))["paraphrase"]
    torch.testing.assert_close(alone, terms["paraphrase"][1:], rtol=1e-3, atol=1e-9)


def test_images_are_as_sharp_as_a_side_that_the_recipe_names() -> None:
    recipe = motion_recipe()
    sides = (16, recipe.data.size_px[1])
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=sides))
    stage = make_stage(recipe, model=MODEL)
    sharp = set()
    for step in range(8):
        batch = moving_batch(recipe, (2 * step, 2 * step + 1))
        seen = stage._augmented(batch)
        assert seen.video.shape == batch.video.shape
        sharp.add(torch.equal(seen.video, stage.randomly_flipped(batch).video))
    assert sharp == {True, False}
    assert bool(stage(moving_batch(recipe))[TOTAL].isfinite().all())


def test_a_flip_changes_images_motion_and_captions_together() -> None:
    recipe = motion_recipe()
    stage = make_stage(recipe, model=MODEL)
    batch = moving_batch(recipe, tuple(range(8)))
    batch = replace(batch, captions=("a red ball rolls to the left",) * 8)
    seen = stage.randomly_flipped(batch)
    turned = [caption.endswith("right") for caption in seen.captions]
    assert 0 < sum(turned) < 8
    for index, other in enumerate(turned):
        video = batch.video[index].flip(-2) if other else batch.video[index]
        assert torch.equal(seen.video[index], video)
        sign = -1 if other else 1
        assert float(seen.field[index, 0].sum()) == sign * float(batch.field[index, 0].sum())
        columns = seen.field[index, 1].abs().sum((0, 1)) > 0
        assert bool(columns[-1]) == bool(seen.moving[index, :, -1].all()) == other


def test_an_untrained_network_predicts_no_motion() -> None:
    recipe = motion_recipe()
    stage = make_stage(recipe, model=MODEL).eval()
    batch = moving_batch(recipe)
    torch.testing.assert_close(stage.measure(batch)["motion_share"], torch.ones(2))
    still = replace(batch, field=torch.zeros_like(batch.field))
    assert bool(stage.measure(still)["motion_share"].isnan().all())


def test_panels_and_measures() -> None:
    recipe = motion_recipe()
    stage = make_stage(recipe, model=MODEL).eval()
    batch = moving_batch(recipe)
    image = stage.panel(batch)
    assert image.ndim == 3 and bool(image.isfinite().all())
    assert set(stage.measure(batch)) == {"flow_error", "motion_share"}


def test_only_the_text_encoder_runs_beside_the_motion_network() -> None:
    stage = make_stage(motion_recipe(), model=MODEL)
    assert [name for name, _ in stage.named_children()] == ["text_encoder", "motion_unet"]


def test_the_kind_needs_a_motion_network() -> None:
    with pytest.raises(ConfigError, match=r"motion_unet\.width: expected a motion network"):
        Recipe(name="x", seed=0, model=BASE, stages=(motion_recipe(),))


@torch.no_grad()
def test_clips_of_the_models_size_are_enlarged_to_what_the_network_sees() -> None:
    recipe = motion_recipe()
    wide = replace(MODEL, motion_unet=replace(MODEL.motion_unet, input_scale=2))
    stage, batch = make_stage(recipe, model=wide), moving_batch(recipe)
    seen = []
    stage.motion_unet.register_forward_pre_hook(lambda _, given: seen.append(given[0].shape[-1]))
    assert all(bool(value.isfinite().all()) for value in stage.measure(batch).values())
    assert set(seen) == {2 * batch.video.shape[3]}
    assert bool(stage(batch)[TOTAL].isfinite().all())


MASKED = replace(MODEL, motion_unet=replace(MODEL.motion_unet, object_mask=True))


def test_a_network_that_is_shown_masks_learns_from_them() -> None:
    recipe = motion_recipe()
    stage = make_stage(recipe, model=MASKED)
    shake_heads(stage)
    terms = stage(moving_batch(recipe, tuple(range(8))))
    terms[TOTAL].sum().backward()
    gradient = stage.motion_unet.input_mask.weight.grad
    assert bool(gradient.isfinite().all()) and bool(gradient.any())
    unmasked = terms["motion_mask"] > 0
    assert not bool(unmasked.all()), "a mask that is shown need not be predicted"


def test_half_of_the_weight_is_on_the_cells_of_the_object() -> None:
    moving = torch.zeros(3, 16, 16, dtype=torch.bool)
    moving[0, 2:3, 5:9] = moving[1] = True
    weights = _cell_weights(moving)
    assert weights[0, 0, 1] == weights[0, 0, 2] == 1 + 16 / 2 and int((weights[0] > 1).sum()) == 2
    assert bool((weights[1] == 2).all()) and bool((weights[2] == 1).all())


@torch.no_grad()
def test_the_true_mask_is_shown_when_it_is_measured() -> None:
    recipe = motion_recipe()
    stage, batch = make_stage(recipe, model=MASKED).eval(), moving_batch(recipe)
    shown = []
    stage.motion_unet.register_forward_pre_hook(lambda _, given: shown.append(given[5]))
    stage.measure(batch)
    assert shown and all(torch.equal(one > 0, batch.moving) for one in shown)


def test_no_mask_is_predicted_where_no_loss_asks_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = replace(motion_recipe(), losses=MotionDiffusionLosses())
    stage = make_stage(recipe, model=MASKED)
    shake_heads(stage)
    monkeypatch.delattr(type(stage.motion_unet), "predict_motion_and_mask")
    assert set(stage(moving_batch(recipe))) == {"flow", TOTAL}


def test_runs_from_before_masks_were_shown_go_on() -> None:
    def print_of(model: ModelConfig, *, without: bool = False) -> str:
        data = recipe_to_dict(Recipe(name="x", seed=0, model=model, stages=(motion_recipe(),)))
        if without:
            del data["model"]["motion_unet"]["object_mask"]
        return fingerprint_of(data, "motion_diffusion", "")

    assert print_of(MODEL) == print_of(MODEL, without=True)
    assert print_of(MASKED) != print_of(MODEL)

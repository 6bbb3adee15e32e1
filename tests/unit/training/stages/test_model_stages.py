"""What each stage runs, trains and measures."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import STAGES, make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.models.config.model import MonocularDepthConfig
from diff4splat.training.recipe.losses import (
    DynamicLosses,
    MotionLosses,
    ReconstructionLosses,
)
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.previews import motion_rows
from diff4splat.training.trainer.distributed.parallel import StageModule
from diff4splat.training.trainer.loading.samples import replacement

EXPECTED_TERMS = {
    "vae": {"photometric", "perceptual", "kl"},
    "static-low": {"photometric", "perceptual", "depth", "smoothness"},
    "static-high": {"photometric", "perceptual", "depth", "smoothness"},
    "dynamic": {"photometric", "perceptual", "depth", "smoothness", "motion"},
    "video_diffusion": {"flow"},
    "joint": {"flow", "photometric", "perceptual", "depth", "smoothness", "motion"},
}


@pytest.mark.parametrize("name", STAGES)
def test_every_term_has_one_finite_value_per_sample(name: str) -> None:
    recipe = stage_recipe(name)
    terms = make_stage(recipe)(make_batch(recipe, (0, 1)))
    assert set(terms) == EXPECTED_TERMS[name] | {TOTAL}
    for value in terms.values():
        assert value.shape == (2,) and bool(torch.isfinite(value).all())


@pytest.mark.parametrize("name", STAGES)
def test_gradients_are_finite_and_reach_exactly_the_trained_parts(name: str) -> None:
    recipe = stage_recipe(name)
    stage = make_stage(recipe)
    shake_heads(stage)
    stage(make_batch(recipe))[TOTAL].sum().backward()
    for part in stage.parts:
        gradients = [parameter.grad for parameter in getattr(stage, part).parameters()]
        learns = part in recipe.trained
        assert any(gradient is not None for gradient in gradients) == learns, part
        present = [gradient for gradient in gradients if gradient is not None]
        assert all(bool(torch.isfinite(gradient).all()) for gradient in present), part


@pytest.mark.parametrize("name", ["dynamic", "joint", "video_diffusion"])
def test_samples_do_not_know_of_their_neighbours_in_a_batch(name: str) -> None:
    recipe = stage_recipe(name)
    stage = make_stage(recipe)
    shake_heads(stage)
    both = stage(make_batch(recipe, (2, 3)))[TOTAL]
    alone = torch.cat([stage(make_batch(recipe, (index,)))[TOTAL] for index in (2, 3)])
    torch.testing.assert_close(both, alone, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", ["vae", "video_diffusion", "joint"])
def test_draws_depend_on_the_sample_and_the_seed_alone(name: str) -> None:
    recipe = stage_recipe(name)
    batch = make_batch(recipe)
    torch.manual_seed(1)
    first = make_stage(recipe)(batch)[TOTAL]
    torch.manual_seed(2)
    torch.testing.assert_close(make_stage(recipe)(batch)[TOTAL], first, rtol=0, atol=0)
    assert not torch.equal(make_stage(recipe, seed=1)(batch)[TOTAL], first)


def test_static_stages_do_not_hold_the_deformation_network() -> None:
    stage = make_stage(stage_recipe("static-low"))
    assert not hasattr(stage, "deformation")


def test_frozen_parts_stay_in_eval() -> None:
    stage = make_stage(stage_recipe("dynamic"))
    stage.train()
    assert not stage.vae.training and stage.ldrm.training


@pytest.mark.parametrize(
    ("weight", "term"),
    [("perceptual", "perceptual"), ("depth", "depth"), ("motion", "motion")],
)
def test_a_weight_of_zero_leaves_the_term_out(weight: str, term: str) -> None:
    losses = DynamicLosses()
    if weight == "motion":
        losses = replace(losses, motion=MotionLosses(weight=0.0))
    else:
        losses = replace(losses, reconstruction=ReconstructionLosses(**{weight: 0.0}))
    recipe = replace(stage_recipe("dynamic"), losses=losses)
    stage = make_stage(recipe)
    assert term not in stage(make_batch(recipe))
    if term == "perceptual":
        assert stage.plan.features.calls == 0


def test_the_total_is_the_weighted_sum() -> None:
    weights = ReconstructionLosses(photometric=0.7, perceptual=0.3, depth=0.2, smoothness=5.0)
    recipe = stage_recipe("dynamic", reconstruction=weights, motion=MotionLosses(weight=1.5))
    stage = make_stage(recipe)
    shake_heads(stage)
    terms = stage(make_batch(recipe))
    wanted = (
        0.7 * (terms["photometric"] + 0.3 * terms["perceptual"])
        + 0.2 * (terms["depth"] + 5.0 * terms["smoothness"])
        + 1.5 * terms["motion"]
    )
    torch.testing.assert_close(terms[TOTAL], wanted)


def test_time_alone_moves_nothing_that_is_untrained() -> None:
    recipe = stage_recipe("dynamic")
    batch = make_batch(recipe, static=True)
    stage = make_stage(recipe)
    with torch.no_grad():
        _, rendered = stage.predict(batch)
    assert float(rendered.offsets.abs().max()) == 0
    with torch.no_grad():
        early = replace(batch, target_time=batch.target_time * 0)
        _, later = stage.predict(early)
    assert torch.equal(rendered.rgb, later.rgb)


def test_measures_know_truth_from_standstill() -> None:
    recipe = stage_recipe("dynamic")
    measures = make_stage(recipe).measure(make_batch(recipe))
    assert set(measures) == {"psnr", "depth_correlation", "track_error", "track_share"}
    torch.testing.assert_close(measures["track_share"], torch.ones(1))
    still = make_stage(recipe).measure(make_batch(recipe, static=True))
    assert bool(still["track_share"].isnan().all())


@pytest.mark.parametrize("name", STAGES)
def test_panels_are_images(name: str) -> None:
    recipe = stage_recipe(name)
    panel = make_stage(recipe).panel(make_batch(recipe))
    assert panel.shape[-1] == 3 and float(panel.min()) >= 0 and float(panel.max()) <= 1


def test_lines_of_one_image_do_not_show_in_the_next() -> None:
    batch = make_batch(stage_recipe("dynamic"))
    still = torch.zeros_like(batch.track_offset[0])
    before = [image.clone() for image in motion_rows(still, batch)[1][1]]
    moved = replace(batch, track_offset=batch.track_offset + 3.0)
    truth, own = (row for _, row in motion_rows(still, moved))
    assert not torch.equal(truth[0], before[0])
    assert all(torch.equal(one, other) for one, other in zip(own, before, strict=True))


@pytest.mark.parametrize("name", STAGES)
def test_half_precision_networks_keep_geometry_and_losses_in_single(name: str) -> None:
    recipe = stage_recipe(name)
    stage = make_stage(recipe)
    batch = make_batch(recipe)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        terms = stage(batch)
    exact = make_stage(recipe)(batch)
    assert terms[TOTAL].dtype == torch.float32
    torch.testing.assert_close(terms[TOTAL], exact[TOTAL], rtol=0.1, atol=0.05)


@pytest.mark.parametrize("name", ["video_diffusion", "joint"])
def test_render_conditions_run_the_depth_prior_frozen(name: str) -> None:
    model = recipe_by_name("test").model
    model = replace(
        model,
        dit=replace(model.dit, render_condition=True),
        monocular_depth=MonocularDepthConfig(channels=4),
    )
    recipe = stage_recipe(name)
    stage = make_stage(recipe, model=model)
    shake_heads(stage)
    calls = []
    stage.monocular_depth.register_forward_hook(lambda *_: calls.append(1))
    terms = stage(make_batch(recipe, (0, 1)))
    terms[TOTAL].sum().backward()
    assert calls and bool(terms[TOTAL].isfinite().all())
    assert all(parameter.grad is None for parameter in stage.monocular_depth.parameters())
    embedding = stage.dit.condition_embedding
    assert all(bool(parameter.grad.any()) for parameter in embedding.parameters())
    assert "hidden_error" in stage.measure(make_batch(recipe))


def test_parts_that_a_stage_does_not_run_cannot_be_trained() -> None:
    recipe = replace(stage_recipe("static-low"), trained=("deformation",))
    with pytest.raises(ConfigError, match=r"static-low: expected .* among vae, ldrm, got deform"):
        make_stage(recipe)
    with pytest.raises(ConfigError, match="got none"):
        make_stage(replace(recipe, trained=()))


def test_text_is_left_out_for_whole_steps_at_the_asked_rate() -> None:
    recipe = replace(stage_recipe("video_diffusion"), text_dropout=0.5, global_batch=2)
    stage = make_stage(recipe)
    StageModule(stage, torch.device("cpu"), "float32").set_training(True)
    dropped = []
    for step in range(40):
        batch = make_batch(recipe, (2 * step, 2 * step + 1))
        calls = []
        hook = stage.text_encoder.register_forward_hook(lambda *_, seen=calls: seen.append(1))
        stage(batch)
        hook.remove()
        dropped.append(not calls)
    assert 0.2 < sum(dropped) / len(dropped) < 0.8


def test_text_is_never_left_out_while_a_stage_is_judged() -> None:
    stage = make_stage(replace(stage_recipe("video_diffusion"), text_dropout=1.0))
    StageModule(stage, torch.device("cpu"), "float32").set_training(False)
    calls = []
    stage.text_encoder.register_forward_hook(lambda *_: calls.append(1))
    stage(make_batch(stage_recipe("video_diffusion")))
    assert calls and not stage.dit.training


def test_all_samples_of_a_step_leave_text_out_together_though_some_were_replaced() -> None:
    stage = make_stage(replace(stage_recipe("video_diffusion"), global_batch=2))
    batch = make_batch(stage.plan.recipe)
    for step in range(4):
        same = [
            replace(batch, sample_index=torch.tensor([replacement(2 * step + place, attempt)]))
            for place in (0, 1)
            for attempt in (0, 1)
        ]
        seeds = {stage.random.per_step(one, "text").initial_seed() for one in same}
        assert len(seeds) == 1


def test_clips_without_a_caption_run_the_same_networks() -> None:
    recipe = replace(stage_recipe("video_diffusion"), text_dropout=0.0)
    stage, batch = make_stage(recipe), make_batch(recipe)
    calls = []
    stage.text_encoder.register_forward_hook(lambda *_: calls.append(1))
    terms = stage(replace(batch, captions=("",)))
    assert calls and bool(torch.isfinite(terms[TOTAL]).all())


def test_measures_leave_out_what_does_not_apply() -> None:
    recipe = stage_recipe("static-low")
    batch = make_batch(recipe, (0, 1))
    flat = batch.target_depth.clone()
    flat[0] = 5.0
    measures = make_stage(recipe).measure(replace(batch, target_depth=flat))
    assert bool(measures["depth_correlation"][0].isnan())
    assert float(measures["depth_correlation"][1].abs()) < 1

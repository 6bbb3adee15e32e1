"""Stages of a model with a refinement decoder: its input and its losses."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig, MonocularDepthConfig, RefinementConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.ldrm.refinement.motion_features import INPUT_CHANNELS, MOTION_CHANNELS
from diff4splat.training.latents.video_latents import encode_video, zero_latents
from diff4splat.training.recipe.losses import MotionLosses, ReconstructionLosses
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL

REFINEMENT = RefinementConfig(channels=6, match_channels=4, cost_volume_depths=4, border_cells=4)
MODEL: ModelConfig = replace(tiny_size(), refinement=REFINEMENT)
ON_PRIOR: ModelConfig = replace(
    MODEL,
    refinement=replace(REFINEMENT, depth_prior=True),
    monocular_depth=MonocularDepthConfig(channels=8),
)
PRETRAIN, MOTION = "posed_video_pretrain", "motion"


def refined(name: str) -> StageRecipe:
    """The stage with key frames and with their depth in the loss."""
    like = {PRETRAIN: "static-low", MOTION: "dynamic"}.get(name, name)
    recipe, losses = stage_recipe(like), ReconstructionLosses(depth_log=1.0)
    data = replace(recipe.data, keyframe_stride=4)
    if name == MOTION:
        losses = MotionLosses()
        return replace(recipe, kind=MOTION, data=data, trained=("deformation",), losses=losses)
    if name in ("dynamic", "joint"):
        losses = replace(recipe.losses, reconstruction=losses)
    recipe = replace(recipe, losses=losses)
    if name != PRETRAIN:
        return replace(recipe, data=data)
    return replace(recipe, kind=PRETRAIN, data=data, use_ground_truth_frames=True)


@pytest.mark.parametrize("name", [PRETRAIN, "static-low", "dynamic", "joint"])
def test_terms_and_gradients_are_finite_and_reach_what_learns(name: str) -> None:
    recipe = refined(name)
    stage = make_stage(recipe, model=MODEL)
    shake_heads(stage)
    terms = stage(make_batch(recipe, (0, 1)))
    assert "depth_log" in terms and ("motion" in terms) == (name in ("dynamic", "joint"))
    terms[TOTAL].sum().backward()
    for part in recipe.trained:
        gradients = [p.grad for p in getattr(stage, part).parameters() if p.grad is not None]
        assert gradients and all(bool(g.isfinite().all()) for g in gradients), part


@pytest.mark.parametrize("name", [PRETRAIN, "static-low", MOTION, "dynamic", "joint"])
def test_the_depth_prior_is_where_key_frames_start_and_learns_nothing(name: str) -> None:
    recipe = refined(name)
    stage = make_stage(recipe, model=ON_PRIOR)
    batch = make_batch(recipe, (0, 1))
    latent = zero_latents(ON_PRIOR, batch)
    flat = stage.scenes.posed_video(batch, latent)
    assert not flat.start.prior.any()
    shake_heads(stage)
    shaken = stage.scenes.posed_video(batch, latent)
    assert bool(shaken.start.prior.any()) and not shaken.start.parallax.requires_grad
    stage(batch)[TOTAL].sum().backward()
    assert all(p.grad is None for p in stage.monocular_depth.parameters())
    if name != MOTION:
        assert bool(stage.ldrm.refinement.decoder.input_start.weight.grad.any())


def test_motion_alone_is_the_dynamic_stage_without_images() -> None:
    stages = [make_stage(refined(name), model=MODEL) for name in (MOTION, "dynamic")]
    for stage in stages:
        shake_heads(stage)
    batch = make_batch(refined("dynamic"), (0, 1))
    alone, whole = (stage(batch) for stage in stages)
    assert set(alone) == {"motion", TOTAL}
    torch.testing.assert_close(alone["motion"], whole["motion"])
    weight = stages[0].plan.recipe.losses.weight
    torch.testing.assert_close(alone[TOTAL], weight * alone["motion"])
    alone[TOTAL].sum().backward()
    assert all(p.grad is None for p in stages[0].ldrm.parameters())
    assert any(bool(p.grad.any()) for p in stages[0].deformation.parameters())
    assert {"psnr", "track_share"} <= set(stages[0].measure(batch))


def test_many_times_at_once_are_the_same_as_each_alone() -> None:
    stage = make_stage(refined(MOTION), model=MODEL)
    shake_heads(stage)
    channels = stage.deformation.input_conv.in_channels + MOTION_CHANNELS - INPUT_CHANNELS
    tokens = torch.rand(2, channels, 2, 8, 8)
    times = torch.tensor([[0.0, 0.3], [0.5, 1.0]])
    together = stage.deformation.at_times(tokens, times)
    for time, found in zip(times, together, strict=True):
        torch.testing.assert_close(found, stage.deformation(tokens, time))


def test_images_alone_need_no_autoencoder() -> None:
    recipe = refined(PRETRAIN)
    stage = make_stage(recipe, model=MODEL)
    assert not hasattr(stage, "vae")
    latent = zero_latents(MODEL, make_batch(recipe))
    assert latent.shape == (1, 4, 2, 4, 4) and not latent.any()


@pytest.mark.parametrize("use_ground_truth_frames", [True, False])
def test_the_first_image_is_always_the_true_one(use_ground_truth_frames: bool) -> None:
    recipe = replace(refined("static-low"), use_ground_truth_frames=use_ground_truth_frames)
    stage, batch = make_stage(recipe, model=MODEL), make_batch(recipe)
    video = stage.scenes.posed_video(batch, encode_video(stage.vae, batch))
    seen = video.rgb.movedim(1, -1)
    truth = unit_rgb(batch.video)
    assert torch.equal(seen[:, 0], truth[:, 0])
    assert torch.equal(seen[:, 1:], truth[:, 1:]) == use_ground_truth_frames


def test_without_a_refinement_decoder_there_is_no_posed_video() -> None:
    recipe = stage_recipe("static-low")
    stage, batch = make_stage(recipe), make_batch(recipe)
    assert stage.scenes.posed_video(batch, encode_video(stage.vae, batch)) is None


def test_followed_points_are_those_of_key_frames() -> None:
    batch = make_batch(refined("dynamic"))
    frames = batch.track_cell[..., 0][batch.track_valid]
    assert set(frames.tolist()) <= {0, 4}
    assert batch.depth.shape[1] == 2

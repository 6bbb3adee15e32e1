"""Counted operations and bytes against formulas, and what they say of the paper's recipe."""

from dataclasses import replace

import pytest

from diff4splat.configs.paper import paper_recipe
from diff4splat.configs.small import small_recipe
from diff4splat.errors import ConfigError
from diff4splat.models.config.sizes import paper_size
from diff4splat.training.forecast.operations import SampleShape, count
from diff4splat.training.forecast.plan import plan_stage

SHAPE = SampleShape(frames=49, size_px=(512, 512))
TOKENS = 13 * 32 * 32


def test_operations_of_the_video_model_follow_from_its_sizes() -> None:
    dit, counted = paper_size().dit, count("dit", paper_size(), SHAPE)
    width = dit.width
    per_token = 4 * width**2 + 2 * width**2 + 2 * width * dit.feedforward_width
    matrices = 2 * TOKENS * per_token * dit.blocks
    attention = 4 * TOKENS**2 * width * dit.blocks
    assert counted.flops == pytest.approx(matrices + attention, rel=0.02)
    assert counted.blocks == dit.blocks
    assert counted.block_bytes > 10 * 2 * TOKENS * width, "of one block, without its logits"
    assert counted.block_bytes < 2 * TOKENS**2 * dit.heads


def test_sharding_divides_states_and_recomputing_saves_activations() -> None:
    recipe = paper_recipe()
    stage = recipe.stage("video_diffusion")
    one, eight = (plan_stage(recipe, stage, gpus) for gpus in (1, 8))
    assert not one.fits and eight.fits
    assert eight.memory.states == pytest.approx(one.memory.states / 8, rel=0.02)
    assert eight.seconds < one.seconds / 6
    keeping = replace(recipe, trainer=replace(recipe.trainer, recompute=False))
    plain = plan_stage(keeping, stage, 8)
    assert plain.memory.activations > 5 * eight.memory.activations and not plain.fits
    assert plain.seconds < eight.seconds


def test_deferred_renders_save_memory_and_cost_time() -> None:
    recipe = paper_recipe()
    at_once = replace(recipe, trainer=replace(recipe.trainer, defer_renders=False))
    deferred, plain = (plan_stage(one, one.stage("dynamic"), 8) for one in (recipe, at_once))
    assert deferred.memory.renders < plain.memory.renders / 2
    assert deferred.seconds > plain.seconds


def test_shared_tokens_divide_activations_of_blocks() -> None:
    recipe = paper_recipe()
    shared = replace(recipe, trainer=replace(recipe.trainer, context_parallel=4))
    one, four = (plan_stage(each, each.stage("video_diffusion"), 8) for each in (recipe, shared))
    assert four.memory.activations < one.memory.activations / 2
    assert four.seconds == pytest.approx(one.seconds, rel=0.3)


def test_what_is_not_counted_is_refused() -> None:
    recipe = small_recipe()
    with pytest.raises(ConfigError, match="measure a few steps"):
        plan_stage(recipe, recipe.stage("motion"), 1)

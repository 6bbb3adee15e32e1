"""A tiny stage of the depth of single images."""

from dataclasses import replace

from stage_fixtures import stage_recipe

from diff4splat.models.config.model import ModelConfig, MonocularDepthConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.recipe.losses import DepthLosses
from diff4splat.training.recipe.stage import StageRecipe

MODEL: ModelConfig = replace(tiny_size(), monocular_depth=MonocularDepthConfig(channels=4))


def depth_recipe(**losses: float) -> StageRecipe:
    like = stage_recipe("dynamic")
    data = replace(like.data, keyframe_stride=4)
    return replace(
        like,
        name="monocular_depth",
        kind="monocular_depth",
        data=data,
        trained=("monocular_depth",),
        losses=DepthLosses(**losses),
    )


def with_sky(batch: ClipBatch) -> ClipBatch:
    depth, target = batch.depth.clone(), batch.target_depth.clone()
    depth[..., :8, :], target[..., :8, :] = 0, 0
    return replace(batch, depth=depth, target_depth=target)

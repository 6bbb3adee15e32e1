"""A tiny stage of the depth of single pictures."""

from dataclasses import replace

from stage_fixtures import stage_recipe

from diff4splat.models.config.model import DetailConfig, ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.recipe import StageRecipe

DETAIL = DetailConfig(width=6, match_channels=4, depths=4, surroundings=4, picture_width=4)
MODEL: ModelConfig = replace(tiny_size(), detail=DETAIL)


def depth_recipe(**losses: float) -> StageRecipe:
    weights = {"depth_log": 1.0, "depth_edges": 0.5, "depth_shift": 1.0, "sky": 0.2} | losses
    like = stage_recipe("dynamic", **weights)
    data = replace(like.data, track_stride=4)
    return replace(like, name="depth", kind="depth", data=data, trained=("ldrm",))


def with_sky(batch: ClipBatch) -> ClipBatch:
    depth, target = batch.depth.clone(), batch.target_depth.clone()
    depth[..., :8, :], target[..., :8, :] = 0, 0
    return replace(batch, depth=depth, target_depth=target)

"""Stages of the ``small`` recipe for ``parallel.py``; CLIPS in the environment names shards."""

import os
from dataclasses import replace
from pathlib import Path

from diff4splat.configs.recipes import recipe_by_name, with_clips
from diff4splat.metrics.features.load import load_features
from diff4splat.models.factory import create_networks
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import Stage
from diff4splat.training.stages.factory import create_stage
from diff4splat.training.stages.model_stage import StagePlan


def static() -> tuple[Stage, ClipSamples, StageRecipe]:
    """LDRM, at low resolution."""
    return _stage("static-low")


def video_diffusion() -> tuple[Stage, ClipSamples, StageRecipe]:
    """The video model and the text encoder."""
    return _stage("video_diffusion")


def _stage(name: str) -> tuple[Stage, ClipSamples, StageRecipe]:
    recipe = with_clips(recipe_by_name("small"), Path(os.environ["CLIPS"]))
    stage_recipe = replace(recipe.stage(name), micro_batch=1)
    plan = StagePlan(model=recipe.model, recipe=stage_recipe, seed=0, features=load_features(None))
    samples = ClipSamples.open(stage_recipe, 0)
    return create_stage(create_networks(recipe.model), plan), samples, stage_recipe

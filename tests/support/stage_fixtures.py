"""Stages of the ``test`` size on an exact little clip, for several test files."""

from dataclasses import replace

import torch
from oracles_clips import make_clip
from torch import Tensor

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.training.batches.clip_batch import ClipBatch, collate
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import SampleKey
from diff4splat.training.stages.factory import create_stage
from diff4splat.training.stages.model_stage import ModelStage, StagePlan

STAGES = tuple(stage.name for stage in recipe_by_name("test").stages)


class SquaredDifference:
    """The simplest perceptual distance, which counts its calls."""

    name = "squared difference"

    def __init__(self) -> None:
        self.calls = 0

    def distance(self, image: Tensor, reference: Tensor) -> Tensor:
        self.calls += 1
        return (image - reference).square().mean((1, 2, 3))


def stage_recipe(name: str, **losses: object) -> StageRecipe:
    """A stage of the ``test`` recipe with other loss weights."""
    recipe = recipe_by_name("test").stage(name)
    return replace(recipe, losses=replace(recipe.losses, **losses))


def make_stage(recipe: StageRecipe, seed: int = 0, model: ModelConfig | None = None) -> ModelStage:
    """The stage with random networks."""
    model = model or recipe_by_name("test").model
    plan = StagePlan(model=model, recipe=recipe, seed=seed, features=SquaredDifference())
    return create_stage(create_networks(model), plan)


def make_batch(
    recipe: StageRecipe, indices: tuple[int, ...] = (0,), static: bool = False
) -> ClipBatch:
    """Samples of one clip each."""
    data = recipe.data
    samples = []
    for index in indices:
        clip = make_clip(
            frames=data.frames,
            size_px=data.size_px,
            views=data.views,
            static=static,
            seed=index,
            tracks=24,
        )
        key = SampleKey(0, recipe.name, index, "sample")
        samples.append(make_sample(clip, data, Origin(key=key, source="made")))
    return collate(samples)


def shake_heads(stage: ModelStage) -> None:
    """Give every zero-initialised layer something to say."""
    generator = torch.Generator().manual_seed(7)
    with torch.no_grad():
        for parameter in stage.parameters():
            if not bool(parameter.any()):
                parameter.add_(0.02 * torch.randn(parameter.shape, generator=generator))

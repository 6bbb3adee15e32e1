"""The recipe of a video model of four steps, from a trained one.

``train --config distil --stage video_distillation --from-model small --latents FOLDER``: all other
stages are those of the ``small`` recipe, for who trains from nothing.

Mean velocities over whole steps, and not consistency between neighbouring levels or derivatives in
the level (consistency distillation, MeanFlow): from one level to the next, 1/120 apart, most of the
change of the model's prediction is not correlated with the next change (docs/log/video-fill.md), so
differences are noise, and sums average it. Distribution matching needs a third network that learns
beside the others.
"""

from dataclasses import replace

from diff4splat.configs.small import small_recipe
from diff4splat.training.recipe.losses import DistillationLosses, FlowLosses
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe

DISTILLATION = "video_distillation"
"""Name and kind of the stage."""


def distil_recipe() -> Recipe:
    """The ``small`` recipe with one more stage."""
    recipe = small_recipe()
    stage = distillation_stage(recipe.stage("video_diffusion"))
    return replace(recipe, name="distil", stages=(*recipe.stages, stage))


def distillation_stage(video: StageRecipe) -> StageRecipe:
    """Few steps of a small learning rate: the student starts as its teacher."""
    return replace(
        video,
        name=DISTILLATION,
        kind="video_distillation",
        steps=1_500,
        global_batch=8,
        micro_batch=8,
        trained=("dit",),
        losses=DistillationLosses(flow=FlowLosses(min_level_weighting=0.25)),
        optimizer=OptimizerSettings(learning_rate=2e-4, warmup_steps=50),
        text_dropout=0.0,
        augment_captions=False,
    )

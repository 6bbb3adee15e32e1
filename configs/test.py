"""A recipe of seconds: random networks of the ``test`` size, to prove that every stage learns."""

from dataclasses import replace

from diff4splat.configs.stages import (
    dynamic_stage,
    joint_stage,
    later,
    reconstruction_gates,
    static_data,
    static_stage,
    video_diffusion_stage,
)
from diff4splat.models.config.sizes import test_size
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.losses import AutoencoderLosses
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings


def test_recipe() -> Recipe:
    """Five frames of 32 × 32; a hundred steps a stage."""
    model = test_size()
    data = DataSettings(
        size_px=model.size_px, frames=model.frames, views=2, target_frames=2, tracks=32, workers=0
    )
    optimizer = OptimizerSettings(learning_rate=3e-3, warmup_steps=10)
    vae = StageRecipe(
        name="vae",
        kind="vae",
        steps=100,
        global_batch=2,
        micro_batch=1,
        trained=("vae",),
        losses=AutoencoderLosses(),
        optimizer=optimizer,
        data=static_data(data),
    )
    static = replace(
        static_stage(vae, data), gates=reconstruction_gates(psnr=5.0, depth_correlation=-1.0)
    )
    dynamic = replace(dynamic_stage(static, data.tracks), timestep_shift=5.0)
    return Recipe(
        name="test",
        seed=0,
        model=model,
        stages=(
            vae,
            static,
            later(static, "static-high", (64, 64), 0.25),
            dynamic,
            video_diffusion_stage(dynamic),
            joint_stage(dynamic),
        ),
        trainer=TrainerSettings(checkpoint_every=50, evaluate_every=50, evaluation_samples=2),
    )


test_recipe.__test__ = False
"""pytest must not take the function for a test."""

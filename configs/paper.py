"""The published recipe where there are numbers: 32 GPUs, seven days (Diff4Splat, implementation).

Steps, sizes, losses, learning rate, weight decay and schedule are the paper's. Batch size, views,
warm-up and clipping are not stated there; the values here are MoVieS's or ours. The stages of the
autoencoder and the video model are ours: the paper starts from pretrained ones.
"""

from dataclasses import replace

from diff4splat.configs.stages import (
    dynamic_data,
    dynamic_stage,
    joint_stage,
    later,
    reconstruction_gates,
    static_stage,
    video_diffusion_stage,
)
from diff4splat.models.config.sizes import paper_size
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.losses import AutoencoderLosses
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings


def paper_recipe() -> Recipe:
    """40,000 static steps at 256², 40,000 at 512², 20,000 dynamic."""
    model = paper_size()
    data = DataSettings(
        size_px=(256, 256), frames=model.frames, views=4, target_frames=8, workers=8
    )
    vae = StageRecipe(
        name="vae",
        kind="vae",
        steps=200_000,
        global_batch=64,
        micro_batch=1,
        trained=("vae",),
        losses=AutoencoderLosses(),
        optimizer=OptimizerSettings(learning_rate=1e-4),
        data=dynamic_data(replace(data, views=1, tracks=0)),
    )
    low = replace(
        static_stage(vae, data),
        steps=40_000,
        global_batch=32,
        optimizer=OptimizerSettings(learning_rate=1e-5),
        gates=reconstruction_gates(psnr=20.0, depth_correlation=0.8),
    )
    high = later(low, "static-high", (512, 512), 1.0)
    dynamic = replace(dynamic_stage(high, data.tracks), steps=20_000)
    video = replace(video_diffusion_stage(dynamic), steps=100_000, timestep_shift=5.0)
    joint = replace(joint_stage(dynamic), steps=5_000, timestep_shift=5.0)
    return Recipe(
        name="paper",
        seed=0,
        model=model,
        stages=(vae, low, high, dynamic, video, joint),
        trainer=TrainerSettings(
            precision="bfloat16", parallel="fsdp2", recompute=True, defer_renders=True
        ),
    )

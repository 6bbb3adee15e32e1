"""The recipe of the ``small`` size, for two CPU cores or one GPU."""

from dataclasses import replace

from diff4splat.configs.stages import (
    dynamic_data,
    dynamic_stage,
    generator_stage,
    joint_stage,
    later,
    reconstruction_gates,
    static_stage,
)
from diff4splat.models.sizes import small_size
from diff4splat.training.recipe import (
    DataSettings,
    Gate,
    OptimizerSettings,
    Recipe,
    StageRecipe,
    TrainerSettings,
)


def small_recipe() -> Recipe:
    """Seventeen frames at 64 × 64, then 128 × 128; learning rates of MoVieS, steps of a small run.

    The paper's 1e-5 is for a pretrained backbone and 32 GPUs; from nothing MoVieS's 4e-4 is usual.
    """
    model = small_size()
    data = DataSettings(size_px=(64, 64), frames=model.frames, views=3, target_frames=4)
    vae = StageRecipe(
        name="vae",
        kind="vae",
        steps=20_000,
        global_batch=4,
        micro_batch=2,
        trained=("vae",),
        optimizer=OptimizerSettings(learning_rate=4e-4, warmup_steps=500),
        data=dynamic_data(replace(data, views=1, tracks=0)),
        gates=(Gate(measure="psnr", bound=26.0),),
    )
    static = replace(
        static_stage(vae, data),
        gates=reconstruction_gates(psnr=18.0, depth_correlation=0.6),
    )
    high = later(static, "static-high", (128, 128), 0.25)
    dynamic = replace(
        dynamic_stage(high, data.tracks),
        steps=10_000,
        gates=(*high.gates, Gate(measure="track_share", bound=0.8, direction="at_most")),
    )
    generator = replace(generator_stage(dynamic), steps=40_000, optimizer=vae.optimizer)
    joint = replace(
        joint_stage(dynamic),
        steps=2_000,
        optimizer=replace(dynamic.optimizer, learning_rate=2e-5, warmup_steps=100),
    )
    return Recipe(
        name="small",
        seed=0,
        model=model,
        stages=(vae, static, high, dynamic, generator, joint),
        trainer=TrainerSettings(ema_decay=0.999),
    )

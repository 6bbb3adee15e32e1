"""Memory and seconds per step of a stage for numbers of GPUs, and whether it fits."""

from dataclasses import dataclass

from diff4splat.models.config.model import ModelConfig
from diff4splat.training.forecast.hardware import (
    FLOPS_SHARE,
    H100,
    MEMORY_SHARE,
    RATE_SHARE,
    Gpu,
)
from diff4splat.training.forecast.memory import STATE_BYTES, Memory, count_weights, stage_memory
from diff4splat.training.forecast.stage_work import StageWork, stage_work
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings

GPUS = (1, 8, 32)
RENDER_BYTES = 400.0
"""Bytes that move per Gaussian and image forward: read, projected, written, sorted in passes."""
RENDER_BACKWARD_BYTES = 600.0
WEIGHT_TRAFFIC_BYTES = 2 + 2 + 4
"""Per weight and micro batch: gathered for both passes in bfloat16, gradients scattered."""
STATE_TRAFFIC = 2.0
"""A step reads and writes the whole state once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePlanRow:
    """One stage on so many GPUs."""

    stage: str
    gpus: int
    memory: Memory
    fits: bool
    seconds: float
    """Per step, without waiting for data."""
    steps: int
    limit: str
    """What a step mostly waits for: computing, links or renders."""

    @property
    def days(self) -> float:
        """Of the whole stage."""
        return self.seconds * self.steps / 86400


def plan_stage(recipe: Recipe, stage: StageRecipe, gpus: int, gpu: Gpu = H100) -> StagePlanRow:
    """The forecast of one stage.

    Raises:
        ConfigError: operations that are not counted.
    """
    work = stage_work(stage, recipe.model)
    memory = stage_memory(stage, recipe.model, recipe.trainer, work, gpus)
    parts = _seconds(recipe.model, stage, recipe.trainer, work, gpus, gpu)
    computing, links, renders, update = parts
    return StagePlanRow(
        stage=stage.name,
        gpus=gpus,
        memory=memory,
        fits=memory.total <= MEMORY_SHARE * gpu.memory_bytes,
        seconds=max(computing + renders, links) + update,
        steps=stage.steps,
        limit=max(
            (computing, "computing"), (links, "links"), (renders, "renders"), key=lambda p: p[0]
        )[1],
    )


def _seconds(
    model: ModelConfig,
    stage: StageRecipe,
    trainer: TrainerSettings,
    work: StageWork,
    gpus: int,
    gpu: Gpu,
) -> tuple[float, float, float, float]:
    """Computing, links and renders of a step on one GPU, and its update."""
    shares = max(gpus // trainer.context_parallel, 1)
    samples = max(stage.global_batch / shares, stage.micro_batch)
    flops = sum(one.flops(trainer.recompute) for one in work.networks) / trainer.context_parallel
    images = work.gaussians * work.images * (2 if trainer.defer_renders else 1) * RENDER_BYTES
    images += work.gaussians * work.images * RENDER_BACKWARD_BYTES
    weights = sum(count_weights(part, model)[0] for part in stage.trained)
    travelling = WEIGHT_TRAFFIC_BYTES * weights * (gpus - 1) / gpus * samples / stage.micro_batch
    state = STATE_BYTES * weights / gpus * STATE_TRAFFIC
    return (
        samples * flops / (FLOPS_SHARE * gpu.flops),
        travelling / (RATE_SHARE * gpu.link_rate(gpus)),
        samples * images / (RATE_SHARE * gpu.memory_rate),
        state / (RATE_SHARE * gpu.memory_rate),
    )

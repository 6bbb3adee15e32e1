"""Bytes that one GPU holds in a stage, by what they are for."""

from dataclasses import dataclass

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.factory import create_networks
from diff4splat.training.forecast.operations import BLOCKS, ENCODE, TEXT_TOKENS
from diff4splat.training.forecast.stage_work import NetworkWork, StageWork
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings

STATE_BYTES = 4 + 4 + 8 + 4
"""Per trained weight: float32 weight, gradient, two moments, average."""
BLOCK_BYTES = 2 + 2 + 4
"""Per weight of a block that is whole: itself, the next one on its way, and its gradient."""
ROOT_BYTES = 4 + 4
"""Per weight outside of the blocks while the networks run."""
GAUSSIAN_BYTES = 4 * (12 + 12 + 14 + 14)
"""Per Gaussian: raw map, activated values, and their gradients."""
DEFORMATION_BYTES = 4 * (10 + 10)
"""Per Gaussian and target time: raw map and its gradient."""
MOVED_BYTES = 4 * (14 + 14)
"""Per Gaussian and image that is being differentiated: the state at its time, and its gradient."""
IMAGE_BYTES = 4 * (12 + 12) + 4 * 24
"""Per Gaussian and image: projected values, gradients, and four entries of tile lists (key and
index, twice for sorting)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Bytes of one GPU."""

    states: float
    """Weights, gradients, moments, averages; frozen weights."""
    gathered: float
    """Weights that are whole for a moment."""
    activations: float
    renders: float

    @property
    def total(self) -> float:
        """All of them at once: their peaks nearly coincide at the start of the backward pass."""
        return self.states + self.gathered + self.activations + self.renders


def stage_memory(
    stage: StageRecipe,
    model: ModelConfig,
    trainer: TrainerSettings,
    work: StageWork,
    gpus: int,
) -> Memory:
    """Memory per GPU; tokens shared by ``context_parallel`` divide the blocks' activations."""
    sizes = {work.name: count_weights(work.name, model) for work in work.networks}
    trained = {name: size for name, size in sizes.items() if name in stage.trained}
    frozen = sum(size[0] for name, size in sizes.items() if name not in stage.trained)
    shards = gpus if trainer.parallel == "fsdp2" else 1
    whole = trainer.parallel != "fsdp2"
    learning = sum(size[0] for size in trained.values())
    states = float(STATE_BYTES * learning / shards + 4 * frozen)
    roots = sum(size[0] - size[1] * size[2] for size in trained.values())
    largest = max((size[1] for size in trained.values()), default=0)
    gathered = 0.0 if whole else float(BLOCK_BYTES * largest + ROOT_BYTES * roots)
    activations = sum(_activations(one, model, stage, trainer) for one in work.networks)
    return Memory(
        states=states,
        gathered=gathered,
        activations=float(stage.micro_batch * activations),
        renders=stage.micro_batch * _renders(work, trainer, "deformation" in sizes),
    )


def count_weights(name: str, model: ModelConfig) -> tuple[int, int, int]:
    """All weights of a network, those of one block, and the number of blocks."""
    part = "vae" if name == ENCODE else name
    network = getattr(create_networks(model, "meta", parts=(part,)), part)
    total = sum(weight.numel() for weight in network.parameters())
    blocks = getattr(network, "blocks", ())
    one = sum(weight.numel() for weight in blocks[0].parameters()) if len(blocks) else 0
    return total, one, len(blocks)


def _activations(
    work: NetworkWork, model: ModelConfig, stage: StageRecipe, trainer: TrainerSettings
) -> float:
    """Kept until the backward pass; a frozen network keeps what one call has at a time."""
    once = work.once
    if not work.trained:
        return 0.0
    if not once.blocks:
        return work.trained * once.kept_bytes
    outside = once.kept_bytes - once.blocks * once.block_bytes
    inside = once.blocks * once.block_bytes
    is_text = work.name == "text_encoder"
    if trainer.recompute:
        tokens = TEXT_TOKENS if is_text else _tokens(stage, model)
        width = getattr(model, BLOCKS[work.name]).width
        inside = once.recomputed_bytes(float(2 * tokens * width)) - outside
    return work.trained * (outside + inside / (1 if is_text else trainer.context_parallel))


def _tokens(stage: StageRecipe, model: ModelConfig) -> int:
    height, width = (side // model.token_px for side in stage.data.size_px)
    return (1 + (stage.data.frames - 1) // TIME_STRIDE) * height * width


def _renders(work: StageWork, trainer: TrainerSettings, moves: bool) -> float:
    per_image = IMAGE_BYTES + (MOVED_BYTES if moves else 0)
    alive = 1 if trainer.defer_renders else work.images
    per_time = DEFORMATION_BYTES * work.times if moves else 0
    return float(work.gaussians * (GAUSSIAN_BYTES + per_time + per_image * alive)) * bool(
        work.images
    )

"""Recipes: everything that decides a training run, as frozen values with their sources.

"paper" is Diff4Splat (arXiv 2511.00503) §3 and appendix; "MoVieS" is its sibling's public code;
"ours" is a choice made here. Functions in ``configs`` return recipes; ``recipe_json`` stores them.
"""

from dataclasses import dataclass, field
from typing import Literal

from diff4splat.errors import ConfigError
from diff4splat.models.config import ModelConfig

StageKind = Literal["vae", "static", "dynamic", "generator", "joint"]
Precision = Literal["float32", "bfloat16"]
Parallel = Literal["none", "ddp", "fsdp2"]
Direction = Literal["at_least", "at_most"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LossWeights:
    """Weight of each loss term; 0 leaves its computation out."""

    flow: float = 1.0
    """Flow matching (paper)."""
    photometric: float = 1.0
    """λ_photo (paper)."""
    perceptual: float = 0.5
    """λ_p, LPIPS beside the squared error (paper)."""
    depth: float = 0.5
    """λ_geo, 1 − Pearson on rendered depth (paper)."""
    smoothness: float = 0.1
    """Total variation of rendered depth; part of L_geo, its weight is not in the paper (ours)."""
    motion: float = 2.0
    """λ_motion (paper)."""
    motion_distance: float = 2.0
    """λ_m: distance between predicted and true displacement, inside the motion loss (paper)."""
    motion_size: float = 1.0
    """Size of the predicted displacement, inside the motion loss (paper; pulls to standstill)."""
    divergence: float = 1e-4
    """KL of the autoencoder's posterior (ours; latent diffusion uses 1e-6 on sums)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimizerSettings:
    """AdamW with warm-up and cosine, per stage."""

    learning_rate: float = 1e-5
    """1e-5 in the paper, 4e-4 in MoVieS."""
    part_rates: tuple[tuple[str, float], ...] = ()
    """Factor of the learning rate for named parts, such as pretrained ones."""
    betas: tuple[float, float] = (0.9, 0.95)
    """MoVieS."""
    weight_decay: float = 1e-4
    """Paper; only on matrices, not on biases and norms."""
    warmup_steps: int = 1000
    """MoVieS."""
    final_fraction: float = 0.0
    """Learning rate at the end of the cosine, as a share of its peak."""
    clip_norm: float = 1.0
    """Largest norm of the whole gradient (MoVieS)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """One source of clips in the mixture."""

    kind: Literal["worlds", "shards"] = "worlds"
    """Drawn on the fly, or read from a folder of shards."""
    folder: str = ""
    """Of the shards."""
    split: Literal["training", "held_out"] = "training"
    still_share: float = 0.25
    """Share of worlds in which nothing moves."""
    weight: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSettings:
    """What one sample looks like."""

    sources: tuple[SourceSettings, ...] = (SourceSettings(),)
    size_px: tuple[int, int] = (128, 128)
    frames: int = 17
    views: int = 3
    """Cameras per clip; the first is the input."""
    target_frames: int = 4
    """Supervised (view, time) pairs per sample and step."""
    tracks: int = 512
    """Tracked points per clip."""
    workers: int = 1
    """Processes that make samples; 0 makes them in the training process."""
    least_depth_share: float = 0.01
    """Clips whose input view has less valid depth are skipped and counted (MoVieS)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """What a stage must reach before the next may begin."""

    measure: str
    bound: float
    direction: Direction = "at_least"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRecipe:
    """One stage."""

    name: str
    kind: StageKind
    steps: int
    global_batch: int
    micro_batch: int
    """Samples per process and forward pass; the rest of the batch is accumulated."""
    trained: tuple[str, ...]
    """Model parts that learn: vae, text_encoder, dit, ldrm, deformation."""
    losses: LossWeights = field(default_factory=LossWeights)
    optimizer: OptimizerSettings = field(default_factory=OptimizerSettings)
    data: DataSettings = field(default_factory=DataSettings)
    gates: tuple[Gate, ...] = ()
    text_dropout: float = 0.1
    """Share of steps without text, for guidance (public code of the paper: 0.1)."""
    level_shift: float = 1.0
    """Above 1 leans to noisy levels; 5 in the paper's public code, at 512² and 49 frames."""

    def __post_init__(self) -> None:
        if self.steps < 1 or self.micro_batch < 1 or self.global_batch % self.micro_batch:
            raise ConfigError(
                f"stage {self.name}: expected steps above 0 and a global batch that micro batches "
                f"divide, got {self.steps}, {self.global_batch} and {self.micro_batch}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainerSettings:
    """How a run is carried out; changing these never changes what is learnt, but for rounding."""

    precision: Precision = "float32"
    """Of network activations; geometry, rendering and losses stay in float32."""
    parallel: Parallel = "none"
    checkpoint_every: int = 500
    evaluate_every: int = 500
    evaluation_samples: int = 8
    keep_checkpoints: int = 3
    ema_decay: float = 0.9999
    """MoVieS; warmed up as 1 − (1 + step)^−0.75."""
    most_skips_in_a_row: int = 20
    """Steps without a finite gradient before the run gives up."""
    most_skips_share: float = 0.01
    spike_factor: float = 5.0
    """A loss this many times its running median is a spike; 0 switches the watch off."""
    spikes_before_rollback: int = 3
    """Spikes in a row before the last good checkpoint is taken up again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A whole training."""

    name: str
    seed: int
    model: ModelConfig
    stages: tuple[StageRecipe, ...]
    trainer: TrainerSettings = field(default_factory=TrainerSettings)

    def stage(self, name: str) -> StageRecipe:
        """The stage of that name.

        Raises:
            ConfigError: there is none.
        """
        for stage in self.stages:
            if stage.name == name:
                return stage
        known = ", ".join(stage.name for stage in self.stages)
        raise ConfigError(f"--stage: expected one of {known}, got {name!r}")

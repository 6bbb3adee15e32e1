"""Recipes: everything that decides a training run, as frozen values with their sources.

"paper" is Diff4Splat (arXiv 2511.00503) §3 and appendix; "MoVieS" is its sibling's public code;
"ours" is a choice made here. Functions in ``configs`` return recipes; ``recipe_json`` stores them.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE

StageKind = Literal[
    "vae",
    "sight",
    "static",
    "motion",
    "dynamic",
    "depth",
    "generator",
    "branch",
    "joint",
]
Precision = Literal["float32", "bfloat16"]
Parallel = Literal["none", "ddp", "fsdp2"]
Direction = Literal["at_least", "at_most"]
RECONSTRUCTING = ("sight", "static", "motion", "dynamic", "depth", "joint")
READING = ("generator", "branch", "joint")
"""Kinds that read captions, which speak of left and right."""


def _require(holds: bool, what: str, expected: str, got: object) -> None:
    if not holds:
        raise ConfigError(f"{what}: expected {expected}, got {got}; correct the recipe")


@dataclass(frozen=True, slots=True, kw_only=True)
class LossWeights:
    """Weight of each loss term; 0 leaves its computation out."""

    flow: float = 1.0
    """Flow matching (paper)."""
    flow_level: float = 0.0
    """Velocity errors at levels below count as if they were made here (ours); 0 is the paper. Where
    clean latents are predicted, small levels would otherwise outweigh all others."""
    flow_motion: float = 1.0
    """How much a channel of motion counts, beside 1 for one of the latent (ours)."""
    moves: float = 0.0
    """Cross-entropy of which cells move, for a motion branch (ours; docs/adr/0022): most stand, so
    that a squared error alone takes long to find those that do not."""
    flow_energy: float = 0.0
    """Latent channels count as their share in pictures to this power (ours); 0 is the paper."""
    photometric: float = 1.0
    """λ_photo (paper)."""
    perceptual: float = 0.5
    """λ_p, LPIPS beside the squared error (paper)."""
    depth: float = 0.5
    """λ_geo, 1 − Pearson on rendered depth (paper)."""
    depth_log: float = 0.0
    """|log depth − log truth| of the Gaussians themselves at their own pixels (after MoVieS)."""
    depth_edges: float = 0.0
    """|∇ (log depth − log truth)| of a picture's depth at several scales (after MiDaS)."""
    depth_shift: float = 0.0
    """|1 / depth − 1 / truth| of a picture, in units of one over the plane's depth (ours): how far
    a pixel lands from its place when the camera steps aside."""
    sky: float = 0.0
    """How much nearer than the sky a picture's depth is where it has no truth (ours): for data in
    which nothing else has none."""
    smoothness: float = 0.1
    """Total variation of rendered depth; part of L_geo, its weight is not in the paper (ours)."""
    motion: float = 2.0
    """λ_motion (paper)."""
    motion_distance: float = 2.0
    """λ_m: distance between predicted and true displacement, inside the motion loss (paper)."""
    motion_size: float = 1.0
    """Size of the predicted displacement, inside the motion loss (paper; pulls to standstill)."""
    motion_width: float = 0.0
    """Distance, in model units, below which the motion loss is quadratic (ours); 0 is the paper."""
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

    def __post_init__(self) -> None:
        for name in ("learning_rate", "clip_norm"):
            value = getattr(self, name)
            _require(0 < value < math.inf, f"optimizer.{name}", "a number above 0", value)
        inside = all(0 <= beta < 1 for beta in self.betas)
        _require(inside, "optimizer.betas", "numbers from 0 to below 1", self.betas)
        decay, warmup = self.weight_decay, self.warmup_steps
        _require(0 <= decay < math.inf, "optimizer.weight_decay", "at least 0", decay)
        _require(warmup >= 0, "optimizer.warmup_steps", "at least 0", warmup)
        share = self.final_fraction
        _require(0 <= share <= 1, "optimizer.final_fraction", "0 to 1", share)


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """One source of clips in the mixture."""

    kind: Literal["worlds", "shards", "latents"] = "worlds"
    """Drawn on the fly, read from a folder of shards, or encoded already (generator only)."""
    folder: str = ""
    """Of the shards or latents."""
    split: Literal["training", "held_out"] = "training"
    still_share: float = 0.25
    """Share of worlds in which nothing moves."""
    weight: float = 1.0

    def __post_init__(self) -> None:
        _require(0 <= self.still_share <= 1, "source.still_share", "0 to 1", self.still_share)
        _require(0 <= self.weight < math.inf, "source.weight", "at least 0", self.weight)
        named = self.kind == "worlds" or self.folder != ""
        _require(named, "source.folder", "the folder of the shards or latents", "none")


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSettings:
    """What one sample looks like."""

    sources: tuple[SourceSettings, ...] = (SourceSettings(),)
    size_px: tuple[int, int] = (128, 128)
    frames: int = 17
    """Of the input video."""
    input_stride: int = 1
    """Clip frames per input frame; those between are seen by targets alone (unseen times)."""
    augment: bool = False
    """Other input views, mirrored and backwards clips; only for stages without text."""
    crop_px: tuple[int, int] = (0, 0)
    """Random window (height, width) cut out of pictures of ``size_px``; 0 takes the whole."""
    views: int = 3
    """Cameras per clip; the first is the input."""
    target_frames: int = 4
    """Supervised (view, time) pairs per sample and step."""
    tracks: int = 512
    """Tracked points per clip."""
    moving_targets: bool = True
    """False judges moving clips at their first frame alone: for stages in which nothing moves."""
    moments: bool = False
    """Clips hold only the first frame and the last of each latent frame, which are quickly drawn:
    all that a motion branch looks at."""
    track_stride: int = 1
    """Input frames from one to the next whose pixels carry Gaussians, and so can be followed."""
    workers: int = 1
    """Processes that make samples; 0 makes them in the training process."""
    in_memory: bool = False
    """Clips of shards are read and decoded once, and kept by every process that makes samples."""
    least_depth_share: float = 0.01
    """Clips whose input view has less valid depth are skipped and counted (MoVieS)."""

    def __post_init__(self) -> None:
        weight = sum(source.weight for source in self.sources)
        _require(weight > 0, "data.sources", "some with a weight above 0", f"{len(self.sources)}")
        for name in ("frames", "input_stride", "track_stride", "views", "target_frames"):
            value = getattr(self, name)
            _require(value >= 1, f"data.{name}", "at least 1", value)
        for name in ("tracks", "workers"):
            value = getattr(self, name)
            _require(value >= 0, f"data.{name}", "at least 0", value)
        _require(min(self.size_px) >= 8, "data.size_px", "sides of at least 8", self.size_px)
        cuts = zip(self.crop_px, self.size_px, strict=True)
        fits = max(self.crop_px) == 0 or all(0 < part <= whole for part, whole in cuts)
        _require(fits, "data.crop_px", "0, or sides that size_px has room for", self.crop_px)
        share = self.least_depth_share
        _require(0 <= share <= 1, "data.least_depth_share", "0 to 1", share)

    @property
    def clip_frames(self) -> int:
        """Frames of a clip from the first input frame to the last."""
        return 1 + (self.frames - 1) * self.input_stride // self.moment_stride

    @property
    def moment_stride(self) -> int:
        """Frames of a whole clip from one that is there to the next."""
        return TIME_STRIDE * self.input_stride if self.moments else 1


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
    true_pictures: bool = False
    """The detail decoder sees the clip's pictures instead of decoded ones: a shorter step."""
    single_share: float = 0.0
    """Share of steps that are given the first picture alone (ours; docs/adr/0016)."""
    text_dropout: float = 0.1
    """Share of steps without text, for guidance (public code of the paper: 0.1)."""
    vary_captions: bool = False
    """Captions in other words, shorter, or as a plain sentence (ours)."""
    level_shift: float = 1.0
    """Above 1 leans to noisy levels; 5 in the paper's public code, at 512² and 49 frames."""

    def __post_init__(self) -> None:
        counts = (self.steps, self.micro_batch, self.global_batch)
        if min(counts) < 1 or self.global_batch % self.micro_batch:
            raise ConfigError(
                f"stage {self.name}: expected steps above 0 and a global batch that micro batches "
                f"divide, got {self.steps}, {self.global_batch} and {self.micro_batch}"
            )
        for name in ("text_dropout", "single_share"):
            share = getattr(self, name)
            _require(0 <= share <= 1, f"stage {self.name}: {name}", "0 to 1", share)
        shift = self.level_shift
        _require(0 < shift < math.inf, f"stage {self.name}: level_shift", "above 0", shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainerSettings:
    """How a run is carried out; changing these never changes what is learnt, but for rounding."""

    precision: Precision = "float32"
    """Of network activations; geometry, rendering and losses stay in float32."""
    compile: bool = False
    """The networks that a stage names run through ``torch.compile``; most stages name none."""
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
    outlier_factor: float = 50.0
    """A loss this many times its running median is not learnt from; 0 learns from everything."""
    spike_factor: float = 5.0
    """A loss this many times its running median is a spike; 0 switches the watch off."""
    spikes_before_rollback: int = 3
    """Spikes in a row before the last good checkpoint is taken up again."""

    def __post_init__(self) -> None:
        at_least_1 = ("checkpoint_every", "evaluate_every", "keep_checkpoints")
        for name in (*at_least_1, "most_skips_in_a_row", "spikes_before_rollback"):
            value = getattr(self, name)
            _require(value >= 1, f"trainer.{name}", "at least 1", value)
        samples = self.evaluation_samples
        _require(samples >= 0, "trainer.evaluation_samples", "at least 0", samples)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A whole training."""

    name: str
    seed: int
    model: ModelConfig
    stages: tuple[StageRecipe, ...]
    trainer: TrainerSettings = field(default_factory=TrainerSettings)

    def __post_init__(self) -> None:
        names = [stage.name for stage in self.stages]
        _require(len(set(names)) == len(names) > 0, "stages", "different names", ", ".join(names))
        for stage in self.stages:
            self._require_fit(stage)

    def _require_fit(self, stage: StageRecipe) -> None:
        """Stages that see need a detail decoder; with one, only key frames have Gaussians."""
        what, detail = f"stage {stage.name}", self.model.detail.used
        seen = stage.kind != "sight" or (detail and stage.true_pictures)
        _require(seen, what, "a detail decoder and true_pictures for its kind", "neither or one")
        encoded = any(source.kind == "latents" for source in stage.data.sources)
        fits = not encoded or stage.kind == "generator"
        _require(fits, f"{what}: data.sources", "latents for a generator stage alone", stage.kind)
        told = stage.data.augment and stage.kind in READING
        _require(not told, f"{what}: data.augment", "false where captions are read", "true")
        fits = not stage.data.moments or stage.kind == "branch"
        _require(fits, f"{what}: data.moments", "false but for a motion branch", "true")
        stride, framed = stage.data.track_stride, detail and stage.kind in RECONSTRUCTING
        fits = not framed or stride == TIME_STRIDE
        branches = stage.kind != "branch" or self.model.dit.motion_width > 0
        _require(branches, f"{what}: model.dit.motion_width", "a motion branch for its kind", 0)
        tells = stage.kind != "depth" or (detail and self.model.detail.picture_width > 0)
        _require(tells, f"{what}: model.detail.picture_width", "a network for its kind", 0)
        key_frames = f"{TIME_STRIDE} with a detail decoder"
        _require(fits, f"{what}: data.track_stride", key_frames, stride)

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

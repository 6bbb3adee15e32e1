"""One stage of a recipe."""

import math
from dataclasses import dataclass, field
from typing import Literal

from diff4splat.errors import ConfigError
from diff4splat.models.config.tuning import TUNINGS, Tuning
from diff4splat.training.recipe.checks import require
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.kinds import StageKind
from diff4splat.training.recipe.losses import LOSSES, Losses
from diff4splat.training.recipe.optimizer import OptimizerSettings

Direction = Literal["at_least", "at_most"]


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
    """Model parts that learn, by their names in ``models.factory.PARTS``."""
    losses: Losses
    """Of the class that ``LOSSES`` names for the kind."""
    optimizer: OptimizerSettings = field(default_factory=OptimizerSettings)
    data: DataSettings = field(default_factory=DataSettings)
    gates: tuple[Gate, ...] = ()
    use_ground_truth_frames: bool = False
    """The refinement decoder reads the clip's frames instead of decoded latents: a shorter step."""
    single_image_probability: float = 0.0
    """Share of steps whose input is the first image alone (ours; docs/adr/0016)."""
    text_dropout: float = 0.1
    """Share of steps without text, for guidance (public code of the paper: 0.1)."""
    augment_captions: bool = False
    """Paraphrased and shortened captions (ours)."""
    timestep_shift: float = 1.0
    """Above 1 samples high levels more often; 5 in the paper's public code, at 512² and 49
    frames."""

    public_backbone: bool = False
    """A part that starts from random weights takes those of its image backbone from the Python
    package that carries them (ADR 32)."""

    tuning: Tuning = "full"
    """What of the video model learns: everything, the layers added to a public model alone
    (adapters), or these and low-rank corrections of its attention (lora)."""
    lora_rank: int = 16

    def __post_init__(self) -> None:
        require(
            self.tuning in TUNINGS,
            f"stage {self.name}: tuning",
            "full, adapters or lora",
            self.tuning,
        )
        require(self.lora_rank >= 1, f"stage {self.name}: lora_rank", "at least 1", self.lora_rank)
        counts = (self.steps, self.micro_batch, self.global_batch)
        if min(counts) < 1 or self.global_batch % self.micro_batch:
            raise ConfigError(
                f"stage {self.name}: expected steps above 0 and a global batch that micro batches "
                f"divide, got {self.steps}, {self.global_batch} and {self.micro_batch}"
            )
        losses, got = LOSSES[self.kind], type(self.losses)
        require(got is losses, f"stage {self.name}: losses", losses.__name__, got.__name__)
        for name in ("text_dropout", "single_image_probability"):
            share = getattr(self, name)
            require(0 <= share <= 1, f"stage {self.name}: {name}", "0 to 1", share)
        shift = self.timestep_shift
        require(0 < shift < math.inf, f"stage {self.name}: timestep_shift", "above 0", shift)

"""How a run is carried out."""

from dataclasses import dataclass
from typing import Literal

from diff4splat.training.recipe.checks import require

Precision = Literal["float32", "bfloat16"]
Parallel = Literal["none", "ddp", "fsdp2"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainerSettings:
    """How a run is carried out; these settings change the result by rounding alone."""

    precision: Precision = "float32"
    """Of network activations; geometry, rendering and losses stay in float32."""
    compile: bool = False
    """The networks that a stage names run through ``torch.compile``; most stages name none."""
    parallel: Parallel = "none"
    recompute: bool = False
    """Activation checkpointing: blocks run again in the backward pass instead of keeping what they
    computed; a third more time, and memory for one block."""
    defer_renders: bool = False
    """Renders are made without a graph and again, one by one, in the backward pass."""
    context_parallel: int = 1
    """Processes that share the tokens of each sample; they divide the heads of every attention."""
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
    """Steps whose loss exceeds this multiple of its running median are skipped; 0 skips none."""
    spike_factor: float = 5.0
    """A loss above this multiple of its running median is a spike; 0 switches detection off."""
    spikes_before_rollback: int = 3
    """Spikes in a row before training returns to the last good checkpoint."""

    def __post_init__(self) -> None:
        at_least_1 = ("checkpoint_every", "evaluate_every", "keep_checkpoints")
        for name in (*at_least_1, "most_skips_in_a_row", "spikes_before_rollback"):
            value = getattr(self, name)
            require(value >= 1, f"trainer.{name}", "at least 1", value)
        group = self.context_parallel
        require(group >= 1, "trainer.context_parallel", "at least 1", group)
        alone = group > 1 and self.parallel == "none"
        require(not alone, "trainer.context_parallel", "1 without ddp or fsdp2", group)
        samples = self.evaluation_samples
        require(samples >= 0, "trainer.evaluation_samples", "at least 0", samples)

"""Settings of the optimizer."""

import math
from dataclasses import dataclass

from diff4splat.training.recipe.checks import require


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimizerSettings:
    """AdamW with warm-up and cosine, per stage."""

    learning_rate: float = 1e-5
    """1e-5 in the paper, 4e-4 in MoVieS."""
    part_rates: tuple[tuple[str, float], ...] = ()
    """Factor of the learning rate for parts, or for modules in them: the pretrained
    ``monocular_depth.backbone``."""
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
            require(0 < value < math.inf, f"optimizer.{name}", "a number above 0", value)
        inside = all(0 <= beta < 1 for beta in self.betas)
        require(inside, "optimizer.betas", "numbers from 0 to below 1", self.betas)
        decay, warmup = self.weight_decay, self.warmup_steps
        require(0 <= decay < math.inf, "optimizer.weight_decay", "at least 0", decay)
        require(warmup >= 0, "optimizer.warmup_steps", "at least 0", warmup)
        share = self.final_fraction
        require(0 <= share <= 1, "optimizer.final_fraction", "0 to 1", share)

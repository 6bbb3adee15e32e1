"""Which noise levels a flow-matching step trains at, and how much each of them counts.

Axes: ``b`` batch. ``level`` is the fraction of noise: 0 is data, 1 is noise. From u uniform in
[0, 1]:

    uniform       level = u
    logit_normal  level = sigmoid(mean + std Φ⁻¹(u))          (Esser et al., arXiv 2403.03206, §3.1)
    shift k       level → k level / (k level + 1 − level)     (ibid. §5.3.2), as ``flow.levels``
"""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.metrics.checks import promote


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelDistribution:
    """A distribution of levels."""

    kind: Literal["uniform", "logit_normal"] = "uniform"
    mean: float = 0.0
    """Of the logit; only for ``logit_normal``. Above 0 leans to noise."""
    std: float = 1.0
    shift: float = 1.0
    """Above 1 leans to noise; what the sampler uses should be used here."""

    def __post_init__(self) -> None:
        if self.kind not in ("uniform", "logit_normal"):
            raise ConfigError(f"levels: expected uniform or logit_normal, got {self.kind!r}")
        for name, value in (("std", self.std), ("shift", self.shift)):
            if not (math.isfinite(value) and value > 0):
                raise ConfigError(f"{name}: expected a finite number above 0, got {value}")
        if not math.isfinite(self.mean):
            raise ConfigError(f"mean: expected a finite number, got {self.mean}")


def sample_levels(uniform: Float[Tensor, " b"], draw: LevelDistribution) -> Float[Tensor, " b"]:
    """Levels in [0, 1] from uniform numbers in [0, 1]; the same numbers give the same levels."""
    (levels,) = promote(uniform)
    if draw.kind == "logit_normal":
        levels = torch.sigmoid(draw.mean + draw.std * torch.special.ndtri(levels))
    if draw.shift == 1:
        return levels
    # The denominator keeps levels 0 and 1 exactly where they are.
    return draw.shift * levels / (draw.shift * levels + (1 - levels))


def min_level_weights(level: Float[Tensor, " b"], least: float) -> Float[Tensor, " b"] | None:
    """Errors of velocity at small levels as if the error of the clean latent were made higher up.

    The velocity of a clean prediction is wrong by its error over the level; errors at levels below
    ``least`` count as if they were made there. None, where that is 0, counts all alike.
    """
    return None if least == 0 else (level / least).clamp_max(1).square()

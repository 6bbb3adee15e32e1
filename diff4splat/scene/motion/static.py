"""Nothing moves: one state for all times, and nothing stored."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.times import require_time_s


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticMotion:
    """The identity at every time."""

    time_range_s: tuple[float, float] = (0.0, 0.0)

    @property
    def moving_index(self) -> Int[Tensor, " m"]:
        """Empty."""
        return torch.zeros(0, dtype=torch.long)

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """``gaussians`` itself."""
        require_time_s(time_s)
        return gaussians

    def select(self, keep: Bool[Tensor, " n"]) -> "StaticMotion":
        """The same motion."""
        del keep
        return self

    def to(self, target: torch.device | torch.dtype) -> "StaticMotion":
        """The same motion: it holds no tensors."""
        del target
        return self

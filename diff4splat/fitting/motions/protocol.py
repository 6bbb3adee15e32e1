"""The interface of a learned motion.

Axes: ``n`` Gaussians, ``m`` moving Gaussians.
"""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates, LossWeights
from diff4splat.scene.motion.protocol import Motion


@runtime_checkable
class LearnedMotion(Protocol):
    """A motion whose parameters are in the parameter table of the scene."""

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """Initial per-Gaussian parameters of the motion."""
        ...

    def shared(self) -> Mapping[str, Tensor]:
        """Initial parameters that all Gaussians share."""
        ...

    def motion(self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int) -> Motion:
        """The motion with the current parameters; differentiable. ``degree`` is of the colours."""
        ...

    def rates(self, rates: LearningRates, extent: float, progress: float) -> Mapping[str, float]:
        """Learning rates of all parameters after the share ``progress`` of the stage."""
        ...

    def penalty(self, table: ParameterTable, weights: LossWeights) -> Tensor | None:
        """Weighted regularisers; None without any."""
        ...

    def split_in_time(
        self, rows: Mapping[str, Tensor], selected: Tensor, generator: torch.Generator
    ) -> tuple[Mapping[str, Tensor], Mapping[str, Tensor]] | None:
        """Earlier and later halves of the ``selected`` rows; None without per-Gaussian times."""
        ...

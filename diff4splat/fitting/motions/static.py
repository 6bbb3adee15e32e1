"""No motion, for the coarse stage and the static baseline."""

from collections.abc import Mapping

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates, LossWeights
from diff4splat.scene.motion.static import StaticMotion


class NoMotion:
    """A static scene."""

    def __init__(self, time_range_s: tuple[float, float]) -> None:
        self._time_range_s = time_range_s

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """None."""
        del count
        return {}

    def shared(self) -> Mapping[str, Tensor]:
        """None."""
        return {}

    def motion(
        self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int
    ) -> StaticMotion:
        """No displacement over the time range of the capture."""
        del table, moving_index, degree
        return StaticMotion(time_range_s=self._time_range_s)

    def rates(self, rates: LearningRates, extent: float, progress: float) -> Mapping[str, float]:
        """None."""
        del rates, extent, progress
        return {}

    def penalty(self, table: ParameterTable, weights: LossWeights) -> Tensor | None:
        """None."""
        del table, weights

    def split_in_time(
        self, rows: Mapping[str, Tensor], selected: Tensor, generator: torch.Generator
    ) -> None:
        """None: there are no per-Gaussian times."""
        del rows, selected, generator

"""No motion: the coarse stage, and the baseline that every motion has to beat."""

from collections.abc import Mapping

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import Rates, Weights
from diff4splat.scene.motion.static import StaticMotion


class Still:
    """Nothing moves."""

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
        """Standing still over the time of the capture."""
        del table, moving_index, degree
        return StaticMotion(time_range_s=self._time_range_s)

    def rates(self, rates: Rates, extent: float, progress: float) -> Mapping[str, float]:
        """None."""
        del rates, extent, progress
        return {}

    def penalty(self, table: ParameterTable, weights: Weights) -> Tensor | None:
        """None."""
        del table, weights

    def split_in_time(
        self, rows: Mapping[str, Tensor], chosen: Tensor, generator: torch.Generator
    ) -> None:
        """None: time is not a column."""
        del rows, chosen, generator

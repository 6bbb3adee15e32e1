"""Native 4D Gaussians as parameters: velocity, time centre and temporal deviation of each.

Axes: ``n`` Gaussians. Deviations are stored as logarithms.
"""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates, LossWeights
from diff4splat.scene.motion.spacetime import SpacetimeMotion

MAX_DEVIATION = 10.0
"""Largest deviation, in time ranges; such a Gaussian is visible at all times."""
SPLIT_DEVIATION, SPLIT_SHIFT = 0.6, 0.8
"""0.6² + 0.8² = 1, so two shifted halves have the mean and variance of the original."""


class SpacetimeGaussians:
    """Each moving Gaussian has a time centre, a temporal deviation and a velocity."""

    def __init__(self, time_range_s: tuple[float, float], min_deviation_s: float) -> None:
        """``min_deviation_s`` keeps a Gaussian visible in at least one frame."""
        self._range_s, self._min_s = time_range_s, min_deviation_s

    @property
    def start_s(self) -> float:
        """First time."""
        return self._range_s[0]

    @property
    def duration_s(self) -> float:
        """Length of the time range."""
        return max(self._range_s[1] - self._range_s[0], 1e-9)

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """No velocity, and visible at all times."""
        return {
            "velocities": torch.zeros(count, 3),
            "time_centers_s": torch.full((count,), sum(self._range_s) / 2),
            "log_deviations": torch.full((count,), MAX_DEVIATION * self.duration_s).log(),
        }

    def shared(self) -> Mapping[str, Tensor]:
        """None."""
        return {}

    def motion(
        self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int
    ) -> SpacetimeMotion:
        """The current motion."""
        del degree
        deviations_s = table["log_deviations"][moving_index].exp()
        return SpacetimeMotion(
            moving_index=moving_index,
            velocities=table["velocities"][moving_index],
            time_centers_s=table["time_centers_s"][moving_index],
            time_deviations_s=deviations_s.clamp(self._min_s, MAX_DEVIATION * self.duration_s),
            time_range_s=self._range_s,
            period_s=self.duration_s,
        )

    def rates(self, rates: LearningRates, extent: float, progress: float) -> Mapping[str, float]:
        """Velocities in extents per duration, times in durations."""
        return {
            "velocities": rates.velocities.at(progress) * extent / self.duration_s,
            "time_centers_s": rates.times.at(progress) * self.duration_s,
            "log_deviations": rates.times.at(progress),
        }

    def penalty(self, table: ParameterTable, weights: LossWeights) -> Tensor | None:
        """None."""
        del table, weights

    def split_in_time(
        self, rows: Mapping[str, Tensor], selected: Tensor, generator: torch.Generator
    ) -> tuple[Mapping[str, Tensor], Mapping[str, Tensor]]:
        """An earlier and a later half, on the trajectory of the original."""
        del generator
        deviation_s = rows["log_deviations"].exp()
        shift_s = torch.where(selected, SPLIT_SHIFT * deviation_s, 0.0)
        shrink = torch.where(selected, math.log(SPLIT_DEVIATION), 0.0)
        halves = []
        for side in (-1.0, 1.0):
            shifted = dict(rows)
            shifted["time_centers_s"] = rows["time_centers_s"] + side * shift_s
            shifted["means"] = rows["means"] + side * shift_s[:, None] * rows["velocities"]
            shifted["log_deviations"] = rows["log_deviations"] + shrink
            halves.append(shifted)
        return halves[0], halves[1]

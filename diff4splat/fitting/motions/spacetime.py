"""Native 4D Gaussians as numbers to be learned: velocity, time centre and deviation of each.

Axes: ``n`` Gaussians. Deviations are learned as logarithms.
"""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import Rates, Weights
from diff4splat.scene.motion.spacetime import SpacetimeMotion

WIDEST = 10.0
"""Largest deviation, in time ranges: wider pulses are always there."""
HALF, SHIFT = 0.6, 0.8
"""0.6² + 0.8² = 1: two halves, shifted to both sides, have the mean and variance of the whole."""


class Pulses:
    """Each moving Gaussian has its own time and velocity."""

    def __init__(self, time_range_s: tuple[float, float], least_deviation_s: float) -> None:
        """``least_deviation_s`` keeps pulses from falling between two frames."""
        self._range_s, self._least_s = time_range_s, least_deviation_s

    @property
    def start_s(self) -> float:
        """First time."""
        return self._range_s[0]

    @property
    def duration_s(self) -> float:
        """Length of the time range."""
        return max(self._range_s[1] - self._range_s[0], 1e-9)

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """Standing, and there all the time."""
        return {
            "velocities": torch.zeros(count, 3),
            "time_centers_s": torch.full((count,), sum(self._range_s) / 2),
            "log_deviations": torch.full((count,), WIDEST * self.duration_s).log(),
        }

    def shared(self) -> Mapping[str, Tensor]:
        """None."""
        return {}

    def motion(
        self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int
    ) -> SpacetimeMotion:
        """The pulses as they are now."""
        del degree
        deviations_s = table["log_deviations"][moving_index].exp()
        return SpacetimeMotion(
            moving_index=moving_index,
            velocities=table["velocities"][moving_index],
            time_centers_s=table["time_centers_s"][moving_index],
            time_deviations_s=deviations_s.clamp(self._least_s, WIDEST * self.duration_s),
            time_range_s=self._range_s,
            period_s=self.duration_s,
        )

    def rates(self, rates: Rates, extent: float, progress: float) -> Mapping[str, float]:
        """Velocities in extents per duration, times in durations."""
        return {
            "velocities": rates.velocities.at(progress) * extent / self.duration_s,
            "time_centers_s": rates.times.at(progress) * self.duration_s,
            "log_deviations": rates.times.at(progress),
        }

    def penalty(self, table: ParameterTable, weights: Weights) -> Tensor | None:
        """None."""
        del table, weights

    def split_in_time(
        self, rows: Mapping[str, Tensor], chosen: Tensor, generator: torch.Generator
    ) -> tuple[Mapping[str, Tensor], Mapping[str, Tensor]]:
        """An earlier and a later half, along the way of the whole."""
        del generator
        deviation_s = rows["log_deviations"].exp()
        shift_s = torch.where(chosen, SHIFT * deviation_s, 0.0)
        narrower = torch.where(chosen, math.log(HALF), 0.0)
        halves = []
        for side in (-1.0, 1.0):
            moved = dict(rows)
            moved["time_centers_s"] = rows["time_centers_s"] + side * shift_s
            moved["means"] = rows["means"] + side * shift_s[:, None] * rows["velocities"]
            moved["log_deviations"] = rows["log_deviations"] + narrower
            halves.append(moved)
        return halves[0], halves[1]

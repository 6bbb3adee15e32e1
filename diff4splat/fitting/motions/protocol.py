"""What the fitting loop knows of a motion.

Axes: ``n`` Gaussians, ``m`` moving Gaussians.
"""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import Rates, Weights
from diff4splat.scene.motion.protocol import Motion


@runtime_checkable
class LearnedMotion(Protocol):
    """A kind of motion whose numbers lie in the table of the scene."""

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """What each of ``count`` Gaussians gets beside its canonical numbers."""
        ...

    def shared(self) -> Mapping[str, Tensor]:
        """What all Gaussians share."""
        ...

    def motion(self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int) -> Motion:
        """The motion that the numbers make; differentiable. ``degree`` is of the colours."""
        ...

    def rates(self, rates: Rates, extent: float, progress: float) -> Mapping[str, float]:
        """Learning rates of columns and shared numbers after a share of the stage."""
        ...

    def penalty(self, table: ParameterTable, weights: Weights) -> Tensor | None:
        """Weighted regularisers; None where there are none."""
        ...

    def split_in_time(
        self, rows: Mapping[str, Tensor], chosen: Tensor, generator: torch.Generator
    ) -> tuple[Mapping[str, Tensor], Mapping[str, Tensor]] | None:
        """Two sets of rows, earlier and later, in place of one; None where time is not a column."""
        ...

"""What every motion can do. Renderers, files, viewers and metrics know only this.

Axes: ``n`` Gaussians, ``m`` moving Gaussians.
"""

from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians


@runtime_checkable
class Motion(Protocol):
    """A rule that carries canonical Gaussians to any time."""

    @property
    def time_range_s(self) -> tuple[float, float]:
        """First and last time that the motion was made for; it is constant outside."""
        ...

    @property
    def moving_index(self) -> Int[Tensor, " m"]:
        """Which Gaussians move at all, in increasing order."""
        ...

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``.

        Raises:
            InputError: not a finite number of seconds (``times.require_time_s``).
        """
        ...

    def select(self, keep: Bool[Tensor, " n"]) -> "Motion":
        """The motion of the Gaussians that a mask keeps."""
        ...

    def to(self, target: torch.device | torch.dtype) -> "Motion":
        """Move or cast every tensor."""
        ...

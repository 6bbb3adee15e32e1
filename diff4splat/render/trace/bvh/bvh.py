"""A bounding volume hierarchy that many images of the same Gaussians share.

Axes: ``n`` Gaussians. Sorting Gaussians into neighbours is slow, and neighbours hardly change from
one moment to the next. So a `Bvh` stores an order of Gaussians and no boxes: `trace` computes the
exact boxes of its own Gaussians and times in this order, and appends Gaussians that the order does
not list, as those too faint when it was built. Any order gives the same results at any time; an
order whose neighbours have moved apart is slower.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.tables import Integers
from diff4splat.scene.gaussians import Gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class Bvh:
    """The order of the Gaussians of a scene in which neighbours follow each other."""

    order: Integers
    """Indices of Gaussians; empty where the compiled tracer cannot use it."""
    count: int
    """Number of Gaussians in the scene."""

    def select(self, mask: Bool[Tensor, " n"]) -> Integers:
        """The order of the Gaussians in ``mask``, with the indices that they get by selection.

        Raises:
            ConfigError: ``mask`` has another length than the scene.
        """
        if len(mask) != self.count:
            raise ConfigError(
                f"bvh: expected one of {len(mask)} Gaussians, got one of {self.count}; build it "
                "with build_bvh from these"
            )
        kept = mask.cpu().numpy()
        if kept.all():
            return self.order
        numbers = np.cumsum(kept, dtype=np.int32) - np.int32(1)
        return numbers[self.order[kept[self.order]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedGaussians:
    """Gaussians, and the range of times of the rays that hit them."""

    gaussians: Gaussians
    moving: MovingCloud | None = None
    earliest_s: float = 0.0
    latest_s: float = 0.0

    def __post_init__(self) -> None:
        if not -math.inf < self.earliest_s <= self.latest_s < math.inf:
            raise InputError(
                "TimedGaussians: expected finite times with earliest_s ≤ latest_s, got "
                f"{self.earliest_s} and {self.latest_s}"
            )
        if self.moving is not None and len(self.moving) != len(self.gaussians):
            raise ShapeError(
                f"TimedGaussians.moving: expected as many as Gaussians, {len(self.gaussians)}, "
                f"got {len(self.moving)}"
            )

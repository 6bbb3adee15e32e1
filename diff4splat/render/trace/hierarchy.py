"""One search tree for many pictures of the same Gaussians.

Axes: ``n`` Gaussians. What takes long is to find out who are neighbours, and that hardly changes
from one moment to the next. So a `SearchTree` is an order of Gaussians and no boxes: `trace` puts
the exact boxes of its own Gaussians and times around it, and puts behind it what the order does not
list, as what was too faint when it was made. So any order gives the same answers at any time; one
whose neighbours have parted takes longer.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.support import refusal
from diff4splat.render.trace.tables import Integers
from diff4splat.scene.gaussians import Gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTree:
    """Who are neighbours among the Gaussians of a scene."""

    order: Integers
    """Indices of Gaussians; empty where no compiled tracer can use it."""
    count: int
    """How many Gaussians the scene has."""

    def among(self, kept: Bool[Tensor, " n"]) -> Integers:
        """The order of the Gaussians that are ``kept``, as they are numbered then.

        Raises:
            ConfigError: there were more or fewer Gaussians when the tree was made.
        """
        if len(kept) != self.count:
            raise ConfigError(
                f"tree: expected one of {len(kept)} Gaussians, got one of {self.count}; make it "
                "with hierarchy.span from these"
            )
        mask = kept.cpu().numpy()
        if mask.all():
            return self.order
        numbers = np.cumsum(mask, dtype=np.int32) - np.int32(1)
        return numbers[self.order[mask[self.order]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Gaussians, and when rays look at them."""

    gaussians: Gaussians
    moving: MovingCloud | None = None
    earliest_s: float = 0.0
    latest_s: float = 0.0

    def __post_init__(self) -> None:
        if not -math.inf < self.earliest_s <= self.latest_s < math.inf:
            raise InputError(
                "State: expected finite times with earliest_s ≤ latest_s, got "
                f"{self.earliest_s} and {self.latest_s}"
            )
        if self.moving is not None and len(self.moving) != len(self.gaussians):
            raise ShapeError(
                f"State.moving: expected as many as Gaussians, {len(self.gaussians)}, "
                f"got {len(self.moving)}"
            )


@torch.no_grad()
def span(states: Sequence[State], settings: TraceSettings) -> SearchTree:
    """A tree for several states of one scene: neighbours are those that stay so through all.

    One state in the middle of a picture is as good as all of them unless they differ much.
    ``settings`` are those that rays will be traced with; others are as right and may be slower.

    Raises:
        InputError: there is no state, or they differ in the number of Gaussians.
    """
    counts = {len(state.gaussians) for state in states}
    if len(counts) != 1:
        raise InputError(
            f"span: expected states of one scene, got {sorted(counts) or 'none'} Gaussians"
        )
    (count,) = counts
    if any(refusal(state.gaussians) is not None for state in states):
        return SearchTree(order=np.empty(0, np.int32), count=count)
    # Numba is loaded with the first tree, not with the library.
    from diff4splat.render.trace.neighbours import neighbours

    return SearchTree(order=neighbours(states, settings), count=count)

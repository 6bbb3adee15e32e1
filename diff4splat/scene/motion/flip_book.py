"""Gaussians of several moments as one scene that shows those of one moment at a time.

Axes: ``f`` moments, ``n`` Gaussians of all moments. Each Gaussian gets a pulse so long that it is
flat, and a gate that ends it half-way to the next moment.
"""

import itertools
import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.motion.spacetime import SpacetimeMotion

_DEVIATIONS = 100.0
"""Pulse deviation in half durations: opacities at the ends are 0.005 % smaller."""
_OVERLAP = 1e-5
"""Share by which durations overlap, so that no time between two moments is empty."""


def flip_book(
    moments: Sequence[Gaussians], times_s: Sequence[float]
) -> tuple[Gaussians, SpacetimeMotion]:
    """All Gaussians, and the motion that shows those of the nearest time.

    Raises:
        ShapeError: not one time per moment, times that do not increase, or harmonics of different
            degrees.
    """
    if len(moments) != len(times_s) or len(moments) < 2 or not _increase(times_s):
        raise ShapeError(f"flip_book: expected two or more increasing times, got {len(times_s)}")
    times = torch.tensor(times_s, dtype=torch.float64)
    between = (times[1:] + times[:-1]) / 2
    starts, stops = torch.cat([times[:1], between]), torch.cat([between, times[-1:]])
    counts = torch.tensor([len(moment) for moment in moments])
    half = (stops - starts) / 2 * (1 + _OVERLAP)
    motion = SpacetimeMotion(
        moving_index=torch.arange(int(counts.sum())),
        velocities=torch.zeros(int(counts.sum()), 3),
        time_centers_s=_per_gaussian((starts + stops) / 2, counts),
        time_deviations_s=_per_gaussian(half * _DEVIATIONS, counts),
        time_range_s=(float(times[0]), float(times[-1])),
        gate=math.exp(-0.5 / _DEVIATIONS**2),
    )
    return concatenate(list(moments)), motion


def _increase(times_s: Sequence[float]) -> bool:
    return all(later > earlier for earlier, later in itertools.pairwise(times_s))


def _per_gaussian(values: Float[Tensor, " f"], counts: Tensor) -> Float[Tensor, " n"]:
    return values.repeat_interleave(counts).float()

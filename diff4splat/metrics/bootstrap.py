"""How sure a mean over a few clips is: bootstrap confidence intervals.

Axes: ``n`` values. Bias-corrected and accelerated ("BCa"; Efron, JASA 1987): quantiles of the means
of resampled values, taken at

    α' = Φ(z₀ + (z₀ + z_α) / (1 − a (z₀ + z_α)))

with z₀ from the share of resampled means below the mean, and a from the skewness of the means that
leave one value out.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError, InputError

MOST_DRAWS = 1 << 20
"""Values drawn at a time: all at once would take too much memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A mean and where the true one probably lies."""

    mean: float
    """NaN without any value."""
    low: float
    """NaN with fewer than two values, as ``high``: one value says nothing about its spread."""
    high: float
    level: float
    count: int


def bootstrap_interval(
    values: Float[Tensor, " n"], level: float = 0.95, resamples: int = 2000, seed: int = 0
) -> Interval:
    """Confidence interval of the mean; the same seed gives the same one.

    Raises:
        ConfigError: a level outside (0, 1), or fewer than one resample.
        InputError: a value is not finite.
    """
    if not 0 < level < 1:
        raise ConfigError(f"level: expected a share between 0 and 1, got {level}")
    if resamples < 1:
        raise ConfigError(f"resamples: expected at least 1, got {resamples}")
    values = values.detach().double().cpu()
    if not bool(values.isfinite().all()):
        raise InputError("values: expected finite numbers, got NaN or infinity; leave them out")
    count = len(values)
    low = high = math.nan
    if count >= 2:
        means = _resampled_means(values, resamples, seed)
        low, high = _accelerated_quantiles(values, means, level)
    mean = float(values.mean()) if count else math.nan
    return Interval(mean=mean, low=low, high=high, level=level, count=count)


def _resampled_means(values: Tensor, resamples: int, seed: int) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    rows = max(MOST_DRAWS // len(values), 1)
    counts = [min(rows, resamples - first) for first in range(0, resamples, rows)]
    shapes = [(count, len(values)) for count in counts]
    draws = (torch.randint(len(values), shape, generator=generator) for shape in shapes)
    return torch.cat([values[draw].mean(1) for draw in draws])


def _accelerated_quantiles(values: Tensor, means: Tensor, level: float) -> tuple[float, float]:
    mean = values.mean()
    # Ties count half, and no share is 0 or 1, whose quantile would be infinite.
    below = float((means < mean).double().mean() + 0.5 * (means == mean).double().mean())
    edge = 0.5 / len(means)
    bias = torch.special.ndtri(torch.tensor(min(max(below, edge), 1 - edge), dtype=torch.float64))
    wanted = torch.special.ndtri(torch.tensor([(1 - level) / 2, (1 + level) / 2]).double())
    shifted = bias + wanted
    shares = torch.special.ndtr(bias + shifted / (1 - _acceleration(values) * shifted))
    low, high = torch.quantile(means, shares.clamp(0, 1)).tolist()
    return low, high


def _acceleration(values: Tensor) -> float:
    """Skewness of leave-one-out means over 6 sqrt(n); for a mean they mirror the values."""
    apart = values - values.mean()
    size = float(apart.abs().amax())
    if size == 0:
        return 0.0
    apart = apart / size
    return float(apart.pow(3).sum() / (6 * apart.square().sum().pow(1.5)))

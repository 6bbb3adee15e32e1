"""Intervals of measures that are no means, such as distances of distributions.

Axes: ``n`` items. The jackknife leaves every item out once: the bootstrap would draw items twice,
which a distance of distributions takes for too little spread.

    se² = (n − 1) / n · Σ (θ_{−i} − mean θ_{−i})²                     (Efron and Stein 1981)
"""

import math
from collections.abc import Callable, Sequence

import torch

from diff4splat.metrics.bootstrap import Interval


def jackknife_interval(
    measure: Callable[[Sequence[int]], float], count: int, level: float = 0.95
) -> Interval:
    """The measure of all items with the interval of a normal distribution around it.

    ``measure`` takes the indices of items; with fewer than three items there is no interval.
    """
    every = list(range(count))
    value, low, high = measure(every), math.nan, math.nan
    if count >= 3:
        left_out = [measure(every[:index] + every[index + 1 :]) for index in every]
        rest = torch.tensor(left_out, dtype=torch.float64)
        error = float(((count - 1) * (rest - rest.mean()).square().mean()).sqrt())
        share = torch.tensor((1 + level) / 2, dtype=torch.float64)
        reach = float(torch.special.ndtri(share)) * error
        low, high = value - reach, value + reach
    return Interval(mean=value, low=low, high=high, level=level, count=count)

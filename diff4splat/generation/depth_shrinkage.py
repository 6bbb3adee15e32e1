"""Relief that the depth prior is unsure of shrinks: it would tear where it is wrong (ours, ADR 39).

Axes: ``h w`` pixels of log depth. Where depth is unsure it comes nearer to the mean around it, in
which sure pixels count most. On images in the domain of training nothing shrinks: there the prior
is unsure at edges and thin objects, and still right on average.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d

UNSURE = 0.4
"""Uncertainty of log depth at which half of the relief stays."""
LEAST = 0.05
"""Pixels that are surer than this weigh alike."""
AROUND = 1 / 8
"""Radius of the mean, as a share of the shorter side."""


def shrunk(
    log_depth: Float[Tensor, "h w"],
    uncertainty: Float[Tensor, "h w"],
    out_of_domain: Float[Tensor, ""],
) -> Float[Tensor, "h w"]:
    """The map with less relief where it is unsure; ``out_of_domain`` is 0 (as it was) to 1."""
    around = _mean_around(log_depth, 1 / (uncertainty.square() + LEAST**2))
    kept = 1 / (1 + out_of_domain * (uncertainty / UNSURE).square())
    return around + kept * (log_depth - around)


def _mean_around(
    values: Float[Tensor, "h w"], weights: Float[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Weighted mean of the pixels around each, as far as the image goes."""
    radius = max(1, round(min(values.shape) * AROUND))
    planes = torch.stack([weights * values, weights])[None]
    sums = avg_pool2d(planes, 2 * radius + 1, 1, radius)[0]
    return sums[0] / sums[1]

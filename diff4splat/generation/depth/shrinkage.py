"""Relief that the depth prior is unsure of shrinks: it would tear where it is wrong (ours, ADR 39).

Axes: ``h w`` pixels of log depth. Where depth is unsure it comes nearer to the mean around it, in
which sure pixels count most. The mean goes as far as the colour does: over the edge of an object it
would mix both sides, and a ramp of depth would go round the object. On images in the domain of
training nothing shrinks: there the prior is unsure at edges and thin objects, and still right on
average.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.depth.weighted_least_squares import (
    Grid,
    between_colors,
    least_squares,
)

UNSURE = 0.4
"""Uncertainty of log depth at which half of the relief stays."""
LEAST = 0.05
"""Pixels that are surer than this weigh alike."""
AROUND = 1 / 16
"""Reach of the mean of even weights, as a share of the shorter side."""
LEAST_WEIGHT = 1e-30
"""So that the mean is defined where nothing is sure."""
COLOR_STEP, THROUGH_EDGES = 0.1, 1e-2
"""Difference of colours, in [0, 1], over which the mean goes on with 1/e; and over any edge."""


def shrunk(
    log_depth: Float[Tensor, "h w"],
    uncertainty: Float[Tensor, "h w"],
    out_of_domain: Float[Tensor, ""],
    rgb: Float[Tensor, "h w 3"],
) -> Float[Tensor, "h w"]:
    """The map with less relief where it is unsure; ``out_of_domain`` is 0 (as it was) to 1."""
    if not bool(out_of_domain):
        return log_depth
    around = mean_within_colors(log_depth, 1 / (uncertainty.double().square() + LEAST**2), rgb)
    kept = 1 / (1 + out_of_domain * (uncertainty / UNSURE).square())
    return around + kept * (log_depth - around)


def mean_within_colors(
    values: Float[Tensor, "h w"], weights: Float[Tensor, "h w"], rgb: Float[Tensor, "h w 3"]
) -> Float[Tensor, "h w"]:
    """Weighted mean around every pixel, as far as there is no edge of colour."""
    across, down = between_colors(rgb, COLOR_STEP, THROUGH_EDGES)
    reach = (AROUND * min(values.shape)) ** 2
    weight = weights.double().clamp_min(LEAST_WEIGHT)
    grid = Grid(weight=weight / weight.mean(), across=reach * across, down=reach * down)
    return least_squares(values, grid)

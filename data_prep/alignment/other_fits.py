"""Fits to compare with, and the paper's own as an option. Axes: ``n`` samples, ``r`` regions.

The paper's Algorithm 1 read literally: medians of relative depth D and of metric depth per region,
then least squares of s · D + t in *depth*. Where disparity has a shift this is wrong by design: 1/d
is no linear function of z then. It is here by name, for comparison and for reproduction.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from diff4splat.data_prep.alignment.disparity_fit import weighted_line
from diff4splat.data_prep.alignment.samples import FitSamples
from diff4splat.errors import InputError

_REGIONS_PER_SIDE = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFit:
    """z = scale · (1 / d) + shift."""

    scale: float
    shift: float


def least_squares(samples: FitSamples) -> tuple[float, float]:
    """(scale, shift) of plain least squares in disparity."""
    return weighted_line(samples.disparity, samples.inverse_depth, np.ones_like(samples.disparity))


def quantile_least_squares(samples: FitSamples) -> tuple[float, float]:
    """(scale, shift) of least squares over the middle 80 % of the reference."""
    low, high = np.quantile(samples.inverse_depth, (0.1, 0.9))
    inside = (samples.inverse_depth >= low) & (samples.inverse_depth <= high)
    return weighted_line(samples.disparity, samples.inverse_depth, inside.astype(np.float64))


def paper_depth_space(samples: FitSamples, region: Int64[np.ndarray, " n"]) -> DepthFit:
    """The paper's Algorithm 1 over numbered regions.

    Raises:
        InputError: fewer than two regions, or all of one relative depth.
    """
    anchors = np.array(
        [
            [np.median(1 / samples.disparity[region == r]), _median_depth(samples, region == r)]
            for r in np.unique(region)
        ]
    )
    if len(anchors) < 2:
        raise InputError(f"alignment: expected two regions or more, got {len(anchors)}")
    scale, shift = weighted_line(anchors[:, 0], anchors[:, 1], np.ones(len(anchors)))
    return DepthFit(scale=scale, shift=shift)


def grid_regions(samples: FitSamples, size_px: tuple[int, int]) -> Int64[np.ndarray, " n"]:
    """Rectangles of every frame, numbered: regions where no segmentation is given."""
    height, width = size_px
    row, column = np.divmod(samples.pixel, width)
    cell = (row * _REGIONS_PER_SIDE // height) * _REGIONS_PER_SIDE
    cell += column * _REGIONS_PER_SIDE // width
    return samples.frame * _REGIONS_PER_SIDE**2 + cell


def _median_depth(samples: FitSamples, chosen: np.ndarray) -> float:
    return float(np.median(1 / samples.inverse_depth[chosen]))

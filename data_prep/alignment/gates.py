"""Whether a fit is good enough to train on. Every reason names the number and its limit."""

from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.alignment.disparity_fit import DisparityFit
from diff4splat.data_prep.alignment.samples import FitSamples

_FEWEST_PER_FRAME = 16
_NEAR = 0.5
"""Relative residual up to which samples show the drift of a frame; inliers alone would hide it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentGates:
    """Limits of a fit."""

    least_inliers: float = 0.5
    most_error: float = 0.10
    """Median relative error over the inliers."""
    most_shift: float = 0.5
    """|shift| over the median of 1/z."""
    most_scale_variation: float = 0.15
    """Spread of the scale over frames, each fitted alone: relative disparity that drifts."""


def refused_because(
    fit: DisparityFit, samples: FitSamples, gates: AlignmentGates
) -> tuple[str, ...]:
    """Reasons to refuse the fit; none if it is accepted."""
    shift = abs(fit.shift) / float(np.median(samples.inverse_depth))
    variation = scale_variation(fit, samples)
    checks = (
        (fit.scale > 0, f"scale: expected above 0, got {fit.scale:.3g}"),
        (
            fit.inlier_share >= gates.least_inliers,
            f"inliers: expected {gates.least_inliers:.0%} or more, got {fit.inlier_share:.1%}",
        ),
        (
            fit.relative_error <= gates.most_error,
            f"error: expected {gates.most_error:.0%} at most, got {fit.relative_error:.1%}",
        ),
        (
            shift <= gates.most_shift,
            f"shift: expected {gates.most_shift:.2g} of the median 1/z at most, got {shift:.2g}",
        ),
        (
            variation <= gates.most_scale_variation,
            f"scale over frames: expected {gates.most_scale_variation:.0%} variation at most, got "
            f"{variation:.0%}",
        ),
    )
    return tuple(reason for passed, reason in checks if not passed)


def scale_variation(fit: DisparityFit, samples: FitSamples) -> float:
    """Half the range of the scales of single frames, shift kept, over their median."""
    fitted = fit.scale * samples.disparity + fit.shift
    near = np.abs(fitted / samples.inverse_depth - 1) < _NEAR
    scales = []
    for frame in np.unique(samples.frame):
        chosen = near & (samples.frame == frame)
        if chosen.sum() >= _FEWEST_PER_FRAME:
            ratio = (samples.inverse_depth[chosen] - fit.shift) / samples.disparity[chosen]
            scales.append(float(np.median(ratio)))
    if len(scales) < 2:
        return 0.0
    return (max(scales) - min(scales)) / 2 / abs(float(np.median(scales)))

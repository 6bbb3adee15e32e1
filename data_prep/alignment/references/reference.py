"""What relative disparity is fitted to. Axes: ``t`` frames, ``h w`` pixels of the input view."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from diff4splat.data.clip import Metric


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Depth, dense or at single pixels."""

    depth: Float32[np.ndarray, "t h w"]
    """z after ``factor``; 0 where unknown."""
    name: str
    metric: Metric
    """What the lengths are once the clip is aligned."""
    factor: float = 1.0
    """What the lengths of the clip (poses, tracks) are to be multiplied by."""
    normaliser: float | None = None
    """What the source had divided its lengths by."""


def aligned_metric(metric: Metric) -> Metric:
    """Of depth fitted to lengths of this kind: estimated depth is never exact."""
    return "aligned" if metric == "exact" else metric

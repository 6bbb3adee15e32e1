"""What the numbers of a depth map are."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

DepthKind = Literal["metric", "millimetres", "relative", "distance", "disparity", "inverse"]
KINDS: dict[str, str] = {
    "metric": "z in metres",
    "millimetres": "z in millimetres",
    "relative": "z up to a factor",
    "distance": "length of the ray in metres",
    "disparity": "1/z up to a factor; 0 is infinitely far",
    "inverse": "1/z up to a factor and an offset",
}
"""Every kind with its meaning; z is along the optical axis."""
METRES_PER_UNIT = {"metric": 1.0, "distance": 1.0, "millimetres": 1e-3}
"""Of the kinds that have a unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthMap:
    """Depth as a network or a file states it, before it is brought to a scene's unit."""

    values: np.ndarray
    """(h, w) float32; NaN is unknown, and so is 0 of kinds that are no inverse."""
    kind: DepthKind
    source: str
    """Which network or file it came from, in words."""

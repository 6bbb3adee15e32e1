"""Parts of an image that are much nearer than all that is beneath them (ours, ADR 55).

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

NEARER, BENEATH_QUANTILE = 1.75, 0.75
"""Inverse depth of a floating part over that of what is beneath it, and which of that: predicted
depth of a part blurs into what is below."""
NEAREST_SHARES = (0.05, 0.1, 0.15, 0.2, 0.25)
"""Of the pixels, that are looked at for connected parts."""
LEAST_AREA, LOWEST_FOOT = 1 / 50, 0.85
"""Of the image; and of its height, where a part ends that something may carry."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatingPart:
    """A connected part of the image that is much nearer than all that is beneath it."""

    mask: Bool[np.ndarray, "h w"]
    rows: slice
    columns: slice
    inverse: float
    """Median of its inverse depth."""
    nearness: float
    """That over the inverse depth of what is beneath it."""

    @property
    def middle(self) -> int:
        """The row half-way down."""
        return (self.rows.start + self.rows.stop) // 2


def nearest_floating_part(inverse: Float[np.ndarray, "h w"]) -> FloatingPart | None:
    """The largest part that floats."""
    for share in reversed(NEAREST_SHARES):
        near = (inverse > np.quantile(inverse, 1 - share)).astype(np.uint8)
        count, component, statistics, _ = cv2.connectedComponentsWithStats(near, connectivity=4)
        parts = [
            _part(inverse, component == number, statistics[number]) for number in range(1, count)
        ]
        floating = [part for part in parts if part is not None and part.nearness >= NEARER]
        if floating:
            return max(floating, key=lambda part: int(part.mask.sum()))
    return None


def _part(
    inverse: Float[np.ndarray, "h w"], mask: Bool[np.ndarray, "h w"], statistics: np.ndarray
) -> FloatingPart | None:
    """None for one that is small, or touches the upper border: it may hang from what is outside."""
    left, top, width, height, area = statistics.tolist()
    right, foot = left + width, top + height
    is_small = area < LEAST_AREA * inverse.size
    if is_small or top == 0 or foot > LOWEST_FOOT * len(inverse):
        return None
    middle = float(np.median(inverse[mask]))
    beneath = float(np.quantile(inverse[foot:, left:right], BENEATH_QUANTILE))
    return FloatingPart(
        mask=mask,
        rows=slice(top, foot),
        columns=slice(left, right),
        inverse=middle,
        nearness=middle / beneath,
    )

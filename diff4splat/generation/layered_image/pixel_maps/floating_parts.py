"""Parts of an image that are much nearer than all that is beneath them (ours, ADR 55).

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

NEARER, BENEATH_QUANTILE = 1.75, 0.75
"""Inverse depth of a floating part over that of what is beneath it, and which of that: predicted
depth of a part blurs into what is below."""
NEAREST_SHARES = (0.05, 0.1, 0.15, 0.2, 0.25)
"""Of the pixels, that are looked at for connected parts."""
LEAST_SOLIDITY = 0.95
"""Of its convex hull, that a part fills: heads are convex."""
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


def largest_floating_part(inverse: Float[np.ndarray, "h w"]) -> FloatingPart | None:
    """The largest that floats, among the most of the nearest pixels that have one."""
    for share in reversed(NEAREST_SHARES):
        near = (inverse > np.quantile(inverse, 1 - share)).astype(np.uint8)
        _, component, statistics, _ = cv2.connectedComponentsWithStats(near, connectivity=4)
        candidates = 1 + np.nonzero(_is_candidate(statistics[1:], near.shape))[0]
        parts = [_part(inverse, component == one, statistics[one]) for one in candidates]
        floating = [part for part in parts if part.nearness >= NEARER and _is_convex(part)]
        if floating:
            return max(floating, key=lambda part: int(part.mask.sum()))
    return None


def _is_candidate(
    statistics: Int[np.ndarray, "n s"], size_px: tuple[int, int]
) -> Bool[np.ndarray, " n"]:
    """Not small, not low, not at the upper border: that may hang from what is outside."""
    top, height, area = statistics[:, [cv2.CC_STAT_TOP, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_AREA]].T
    is_large = area >= LEAST_AREA * size_px[0] * size_px[1]
    return is_large & (top > 0) & (top + height <= LOWEST_FOOT * size_px[0])


def _part(
    inverse: Float[np.ndarray, "h w"],
    mask: Bool[np.ndarray, "h w"],
    statistics: Int[np.ndarray, " s"],
) -> FloatingPart:
    left, top, width, height, _ = statistics.tolist()
    rows, columns = slice(top, top + height), slice(left, left + width)
    middle = float(np.median(inverse[mask]))
    beneath = float(np.quantile(inverse[rows.stop :, columns], BENEATH_QUANTILE))
    return FloatingPart(
        mask=mask, rows=rows, columns=columns, inverse=middle, nearness=middle / beneath
    )


def _is_convex(part: FloatingPart) -> bool:
    hull = cv2.convexHull(np.argwhere(part.mask).astype(np.int32))
    return bool(part.mask.sum() >= LEAST_SOLIDITY * cv2.contourArea(hull))

"""Inverse depth as points of a coarse grid, with the precision of each.

A pixel p = (x, y, 1) of the image plane with inverse depth u is the point p / u.
"""

from dataclasses import dataclass, fields

import cv2
import numpy as np
from jaxtyping import Bool, Float64

SIDE_PX = 172
"""The grid has about this many points a side; maps are sampled, not averaged: edges stay sharp."""
SLOPE_PX, SLOPE_BLUR_PX = 4, 2.0
"""Distance of the differences that slopes are, and of the blur before them."""
PLACE_PX = 0.1
"""Standard deviation of where in the image a value was measured."""
UNIT_ERROR = 0.29
"""Standard deviation of a value that is rounded to 1."""
RELATIVE_ERROR = 1e-7
"""Of float32."""
MOST_LEVELS = 2**16
"""Maps with more different values are not rounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Places on the image plane, their values, and the values' standard deviations and slopes."""

    x: Float64[np.ndarray, "*n"]
    y: Float64[np.ndarray, "*n"]
    value: Float64[np.ndarray, "*n"]
    sigma: Float64[np.ndarray, "*n"]
    slope_x: Float64[np.ndarray, "*n"]
    """∂value/∂x."""
    slope_y: Float64[np.ndarray, "*n"]

    def __len__(self) -> int:
        return self.value.size

    def at(self, chosen: Bool[np.ndarray, "*n"] | np.ndarray) -> "Points":
        """Those of a mask or of indices, in a row."""
        return Points(**{one.name: getattr(self, one.name)[chosen] for one in fields(self)})

    def thinned(self, most: int) -> "Points":
        """At most so many, evenly."""
        if len(self) <= most:
            return self
        return self.at(np.linspace(0, len(self) - 1, most).astype(int))

    @property
    def known(self) -> Bool[np.ndarray, "*n"]:
        """Where everything is finite."""
        return np.isfinite(self.value + self.sigma + self.slope_x + self.slope_y)


def grid_points(values: np.ndarray, tangents: tuple[np.ndarray, np.ndarray]) -> Points:
    """A grid (h, w) of a map; ``tangents`` are x/z of its columns and y/z of its rows."""
    stride = max(1, round(max(values.shape) / SIDE_PX))
    smooth = cv2.GaussianBlur(values.astype(np.float32), (0, 0), SLOPE_BLUR_PX).astype(np.float64)
    slopes = [_slope(smooth, axis) for axis in (1, 0)]
    sigma = _sigma(values, slopes)
    x, y = np.meshgrid(*tangents)
    units = [np.gradient(x, axis=1), np.gradient(y, axis=0)]
    coarse = (slice(stride // 2, None, stride),) * 2
    return Points(
        x=x[coarse].astype(np.float64),
        y=y[coarse].astype(np.float64),
        value=values[coarse].astype(np.float64),
        sigma=sigma[coarse],
        slope_x=(slopes[0] / units[0])[coarse],
        slope_y=(slopes[1] / units[1])[coarse],
    )


def _slope(smooth: np.ndarray, axis: int) -> np.ndarray:
    """Change per pixel; NaN near the edge."""
    slope = np.full(smooth.shape, np.nan)
    inner, ahead, behind = (
        tuple(part if one == axis else slice(None) for one in (0, 1))
        for part in (
            slice(SLOPE_PX, -SLOPE_PX), slice(2 * SLOPE_PX, None), slice(None, -2 * SLOPE_PX),
        )
    )  # fmt: skip
    slope[inner] = (smooth[ahead] - smooth[behind]) / (2 * SLOPE_PX)
    return slope


def _sigma(values: np.ndarray, slopes: list[np.ndarray]) -> np.ndarray:
    """Of every pixel: its place, its rounding, and what neighbours show of noise."""
    gaps = np.diff(np.unique(values[np.isfinite(values)]))
    level = float(gaps.min()) if 0 < len(gaps) < MOST_LEVELS else 0.0
    place = PLACE_PX**2 * (slopes[0] ** 2 + slopes[1] ** 2)
    rounding = (UNIT_ERROR * level) ** 2 + (RELATIVE_ERROR * values) ** 2
    return np.sqrt(place + rounding + _noise(values) ** 2) + np.finfo(np.float32).tiny


def _noise(values: np.ndarray) -> np.ndarray:
    """From second differences, along the smoother axis, their median over 5 × 5 pixels."""
    v = np.nan_to_num(values.astype(np.float32))
    second = np.zeros_like(v)
    across = np.abs(v[1:-1, 2:] - 2 * v[1:-1, 1:-1] + v[1:-1, :-2])
    along = np.abs(v[2:, 1:-1] - 2 * v[1:-1, 1:-1] + v[:-2, 1:-1])
    second[1:-1, 1:-1] = np.minimum(across, along)
    # The smaller of two has a median of 0.40 standard deviations, a second difference √6 of noise.
    return cv2.medianBlur(second, 5).astype(np.float64) / (0.40 * np.sqrt(6))

"""Colour names, and sRGB colours as linear light.

The name of the nearest anchor in CIELAB (D65): d² = (0.55 ΔL)² + Δa² + Δb². Lightness has a lower
weight because shading changes it.
"""

from functools import cache

import numpy as np
from jaxtyping import Float64, Int64

_ANCHORS = {
    "red": "b52b2b d0453f 8c2320 a83a34",
    "orange": "d97a2b e39a4a c2682c d9694f",
    "yellow": "e0c040 d9b44a e8d070 c9a83a",
    "green": "5d8f57 3f6b35 7f9f50 2f5a3a 8fb56a 5c6a34",
    "turquoise": "4f9a98 6fb5b0 3a7f86 7fb0b8",
    "blue": "3a5f96 2244aa 5a83b8 2a3f66 3f6f9e 86a6c8 4c6a86",
    "purple": "6f4a86 7040a0 8f6fae 553a66 a48cc0",
    "pink": "d98a9a e0a6b0 c8647f",
    "brown": "6b452c 8a5e3c 4f3626 7d5a3c 9a7048",
    "beige": "d2b88e c8b090 e3cfa8 bfa67c",
    "white": "e9e6df f5f3ee d9d8d4",
    "grey": "8a8a88 6c6e72 a6a6a2 9aa0a6 54565a",
    "black": "1c1c1e 2b2b2d",
}
_XYZ_FROM_RGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)
_WHITE = np.array([0.9505, 1.0, 1.089])
COLOR_NAMES = tuple(_ANCHORS)
MAIN_COLOR_SHARE = 0.5
"""Share of an object from which it has the name of a colour."""


def color_name(linear: Float64[np.ndarray, "3"]) -> str:
    """The name of a linear RGB colour."""
    return COLOR_NAMES[int(color_numbers(linear[None])[0])]


def main_color_name(linear: Float64[np.ndarray, "n 3"], weights: Float64[np.ndarray, " n"]) -> str:
    """The name of the colour of most of the weight; empty if none has half of it."""
    found = np.bincount(color_numbers(linear), weights, len(COLOR_NAMES))
    most = int(found.argmax())
    return COLOR_NAMES[most] if found[most] >= MAIN_COLOR_SHARE * weights.sum() > 0 else ""


def color_numbers(linear: Float64[np.ndarray, "n 3"]) -> Int64[np.ndarray, " n"]:
    """Indices in ``COLOR_NAMES`` of linear RGB colours."""
    numbers, anchors = _anchors()
    offsets = (anchors - _lab(linear)[:, None]) * np.array([0.55, 1.0, 1.0])
    return numbers[(offsets**2).sum(2).argmin(1)]


@cache
def _anchors() -> tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "n 3"]]:
    pairs = [(k, word) for k, name in enumerate(COLOR_NAMES) for word in _ANCHORS[name].split()]
    colors = np.stack([linear_from_hex(word) for _, word in pairs])
    return np.array([number for number, _ in pairs]), _lab(colors)


def _lab(linear: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    ratio = linear @ _XYZ_FROM_RGB.T / _WHITE
    f = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    first, second, third = f[:, 0], f[:, 1], f[:, 2]
    return np.stack([116 * second - 16, 500 * (first - second), 200 * (second - third)], 1)


def linear_from_hex(word: str) -> Float64[np.ndarray, "3"]:
    """Linear RGB of the sRGB colour ``rrggbb``."""
    return linear_from_srgb(np.array([int(word[k : k + 2], 16) / 255 for k in (0, 2, 4)]))


def linear_from_srgb(value: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
    """Linear RGB of sRGB in [0, 1] (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)

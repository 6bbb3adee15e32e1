"""sRGB colours as linear light."""

import numpy as np
from jaxtyping import Float64


def linear_from_hex(word: str) -> Float64[np.ndarray, "3"]:
    """Linear RGB of the sRGB colour ``rrggbb``."""
    return linear_from_srgb(np.array([int(word[k : k + 2], 16) / 255 for k in (0, 2, 4)]))


def linear_from_srgb(value: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
    """Linear RGB of sRGB in [0, 1] (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)

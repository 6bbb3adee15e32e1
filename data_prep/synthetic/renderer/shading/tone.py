"""From linear light to the bytes of an image: a filmic shoulder, then sRGB (IEC 61966-2-1)."""

from functools import cache

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.renderer.numerics import clamp
from diff4splat.kernels.jit import inlined

_STEPS = 4096


@inlined
def filmic(value):
    """Light to display light below 1: a short toe, then a soft shoulder (Narkowicz 2015)."""
    value = max(value, 0.0)
    return clamp(value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14), 0.0, 1.0)


@inlined
def encoded(value, thresholds):
    """A display light from 0 to 1 as a byte."""
    level = int(thresholds[256 + int(value * _STEPS)])
    while level < 255 and value >= thresholds[level]:
        level += 1
    return level


@cache
def byte_thresholds() -> Float64[np.ndarray, " 4353"]:
    """Where each byte ends, then for each of 4097 steps of light a byte to begin at."""
    ends = np.array([decoded((level + 0.5) / 255) for level in range(255)] + [2.0])
    starts = np.searchsorted(ends, np.arange(_STEPS + 1) / _STEPS, side="right")
    return np.concatenate([ends, starts.astype(np.float64)])


def decoded(value: float) -> float:
    """Linear light of an sRGB value; x to 2.4 is x² times the fifth root of x² (Newton)."""
    if value <= 0.04045:
        return value / 12.92
    x = (value + 0.055) / 1.055
    square, root = x * x, 1.0
    for _ in range(40):
        fourth = root * root * root * root
        root = root - (root * fourth - square) / (5.0 * fourth)
    return square * root

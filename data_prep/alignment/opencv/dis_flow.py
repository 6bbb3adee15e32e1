"""Optical flow by DIS (dense inverse search), there and back. Axes: ``h w`` pixels.

Kroeger et al., "Fast Optical Flow using Dense Inverse Search" (2016), as OpenCV has it. It stands
in for learned flow where no weights are at hand.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

Preset = Literal["ultrafast", "fast", "medium"]
_PRESETS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}
_SMALLEST_SIDE_PX = 16
"""Below, DIS has no patch to search with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowPair:
    """Flow of one image to another and back."""

    forward: Float32[np.ndarray, "h w 2"]
    """(x, y) in pixels."""
    backward: Float32[np.ndarray, "h w 2"]
    consistent: Bool[np.ndarray, "h w"]
    """Inside the other image, and led back to within ``round_trip_px``."""


def dis_flow(
    first: UInt8[np.ndarray, "h w 3"],
    second: UInt8[np.ndarray, "h w 3"],
    preset: Preset = "medium",
) -> Float32[np.ndarray, "h w 2"]:
    """Displacement of every pixel of ``first``; zero where images are too small for DIS."""
    if min(first.shape[:2]) < _SMALLEST_SIDE_PX:
        return np.zeros((*first.shape[:2], 2), np.float32)
    grey = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (first, second)]
    return cv2.DISOpticalFlow_create(_PRESETS[preset]).calc(*grey, None)


def flow_pair(
    first: UInt8[np.ndarray, "h w 3"],
    second: UInt8[np.ndarray, "h w 3"],
    preset: Preset = "medium",
    round_trip_px: float = 1.0,
) -> FlowPair:
    """Flow there and back, and where both agree."""
    forward, backward = dis_flow(first, second, preset), dis_flow(second, first, preset)
    return FlowPair(
        forward=forward,
        backward=backward,
        consistent=round_trip(forward, backward) <= round_trip_px,
    )


def round_trip(
    forward: Float32[np.ndarray, "h w 2"], backward: Float32[np.ndarray, "h w 2"]
) -> Float32[np.ndarray, "h w"]:
    """How far there and back misses, in pixels; infinite where there is outside the image."""
    height, width = forward.shape[:2]
    column, row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height))
    x, y = column + forward[..., 0], row.astype(np.float32) + forward[..., 1]
    back = sampled(backward, x, y)
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    return np.where(inside, np.linalg.norm(forward + back, axis=-1), np.inf).astype(np.float32)


def sampled(values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """``values`` at (x, y), pixel centres at whole numbers; the border is continued."""
    places = (np.nan_to_num(x).astype(np.float32), np.nan_to_num(y).astype(np.float32))
    return cv2.remap(values, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

"""Features of a clip without any network: colours and gradients on a grid of three frames.

Of each of 4 × 4 cells: a histogram of 8 gradient directions, weighted by strength, less its mean
(Dalal and Triggs 2005); and the colour in CIELAB less that of the frame. A feature is a whole
number of 8 bits, so that every product of two clips is exact and equal on every machine.
"""

import base64
import binascii

import cv2
import numpy as np
from jaxtyping import Float64, Int8, UInt8

CELLS, DIRECTIONS, FRAMES = 4, 8, 3
LENGTH = FRAMES * CELLS * CELLS * (DIRECTIONS + 3)
_SIDE_PX, _BLUR_PX = 64, 2.0
"""Blurred, so that neither a pixel's shift nor traces of compression count."""


def clip_features(frames: UInt8[np.ndarray, "3 h w 3"]) -> Int8[np.ndarray, " n"]:
    """The features of a clip, scaled to the range of 8 bits; 0 of images without any structure."""
    values = np.concatenate([_frame_features(frame) for frame in frames])
    most = np.abs(values).max()
    return np.round(values * (127 / most if most > 1e-9 else 0)).astype(np.int8)


def features_text(features: Int8[np.ndarray, " n"]) -> str:
    """As a label of a record."""
    return base64.b64encode(features.tobytes()).decode()


def read_features(text: str) -> Int8[np.ndarray, " n"] | None:
    """Back from a label; None where there is none or a damaged one."""
    try:
        content = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        return None
    return np.frombuffer(content, np.int8) if len(content) == LENGTH else None


def _frame_features(image: UInt8[np.ndarray, "h w 3"]) -> Float64[np.ndarray, " m"]:
    small = cv2.resize(image, (_SIDE_PX, _SIDE_PX), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(small.astype(np.float32) / 255, cv2.COLOR_RGB2LAB).astype(np.float64)
    colors = _cells(lab).mean(1)
    gradients = _gradients(lab[..., 0])
    return np.concatenate(
        [_unit(gradients).reshape(-1), _unit(colors - colors.mean(0)).reshape(-1)]
    )


def _gradients(light: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "c d"]:
    """Root of the strength per direction of every cell, less the mean over directions."""
    down, right = np.gradient(cv2.GaussianBlur(light, (0, 0), _BLUR_PX))
    turns = (np.arctan2(down, right) / (2 * np.pi) % 1) * DIRECTIONS
    # Shared by the two nearest directions: no edge jumps from one to the other.
    away = np.abs(turns[..., None] - np.arange(DIRECTIONS))
    share = np.clip(1 - np.minimum(away, DIRECTIONS - away), 0, None)
    strength = np.hypot(right, down)[..., None] * share
    return _centred(np.sqrt(_cells(strength).sum(1)))


def _cells(values: Float64[np.ndarray, "h w k"]) -> Float64[np.ndarray, "c p k"]:
    """Pixels of every cell."""
    side = _SIDE_PX // CELLS
    blocks = values.reshape(CELLS, side, CELLS, side, -1).transpose(0, 2, 1, 3, 4)
    return blocks.reshape(CELLS * CELLS, side * side, -1)


def _centred(values: Float64[np.ndarray, "c d"]) -> Float64[np.ndarray, "c d"]:
    return values - values.mean(1, keepdims=True)


def _unit(values: Float64[np.ndarray, "c d"]) -> Float64[np.ndarray, "c d"]:
    length = np.linalg.norm(values)
    return values / length if length > 1e-6 else np.zeros_like(values)

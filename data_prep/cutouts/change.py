"""Cutouts in other colours, light and texture, so that only the shape says what they are.

Axes: ``h w`` pixels.
"""

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from diff4splat.data_prep.cutouts.cutout import Cutout

RECOLORED_SHARE = 0.35
TEXTURED_SHARE, TEXTURE_SPREAD = 0.5, (0.05, 0.3)
"""Standard deviation of the logarithm of the texture that is multiplied."""
LOG_GAIN, LOG_SLOPE = 0.3, 0.5
"""Largest change of all pixels, and from one side to the other."""
_HUES = 180
_BLUR_SHARE = 1 / 8
_GREY = 1e-2


def recolored(cutout: Cutout, random: np.random.Generator) -> Cutout:
    """A third of the cutouts with all hues turned."""
    if random.random() >= RECOLORED_SHARE:
        return cutout
    colors = cv2.cvtColor(_bytes(cutout.rgba[..., :3]), cv2.COLOR_RGB2HSV)
    turned = (colors[..., 0].astype(int) + random.integers(_HUES)) % _HUES
    colors[..., 0] = turned.astype(np.uint8)
    rgb = cv2.cvtColor(colors, cv2.COLOR_HSV2RGB).astype(np.float32) / 255
    return replace(cutout, rgba=np.concatenate([rgb, cutout.rgba[..., 3:]], -1))


def lit(cutout: Cutout, random: np.random.Generator) -> Cutout:
    """Brighter or darker, and brighter to one side."""
    height, width = cutout.rgba.shape[:2]
    y, x = np.mgrid[-0.5 : 0.5 : height * 1j, -0.5 : 0.5 : width * 1j].astype(np.float32)
    angle = random.uniform(0, 2 * np.pi)
    slope = LOG_SLOPE * random.random() * (np.cos(angle) * x + np.sin(angle) * y)
    return _multiplied(cutout, slope + LOG_GAIN * random.uniform(-1, 1))


def textured(
    cutout: Cutout, photograph: UInt8[np.ndarray, "p q 3"], random: np.random.Generator
) -> Cutout:
    """Half of the cutouts with the fine structure of a photograph."""
    if random.random() >= TEXTURED_SHARE:
        return cutout
    height, width = cutout.rgba.shape[:2]
    grey = cv2.cvtColor(photograph, cv2.COLOR_RGB2GRAY).astype(np.float32) / 255
    grey = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    detail = np.log(grey + 0.1)
    detail -= cv2.GaussianBlur(detail, (0, 0), max(1.0, _BLUR_SHARE * max(height, width)))
    spread = float(detail.std())
    if spread < _GREY:
        return cutout
    return _multiplied(cutout, detail * np.float32(random.uniform(*TEXTURE_SPREAD) / spread))


def _multiplied(cutout: Cutout, log_factor: Float[np.ndarray, "h w"]) -> Cutout:
    factor = np.exp(log_factor).astype(np.float32)[..., None]
    rgb = (cutout.rgba[..., :3] * factor).clip(0, 1)
    return replace(cutout, rgba=np.concatenate([rgb, cutout.rgba[..., 3:]], -1))


def _bytes(rgb: Float32[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    return (rgb * 255 + 0.5).astype(np.uint8)

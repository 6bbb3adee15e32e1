"""Colour, mask and depth layers of one image, from the file to the frame.

Axes: ``h w`` pixels, ``n`` side of a block. Resampling treats all layers alike: colours are
averaged, but masks and depth are never interpolated across an edge.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from diff4splat.data.capture.capture import Frame
from diff4splat.data_prep.readers.files.image_file import Pixels

_OPAQUE = 0.5
"""Smallest alpha of a valid pixel without a valid background."""
_MIN_VALID_SHARE = 0.999
"""Smallest share of valid source pixels of a valid undistorted pixel."""

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelLayers:
    """The layers of one image."""

    rgb: Float32[np.ndarray, "h w 3"]
    counts: Bool[np.ndarray, "h w"] | None = None
    """Mask of valid pixels; None if all are valid."""
    depth: Float32[np.ndarray, "h w"] | None = None
    """z in scene units; 0 for no depth."""


def composite_over(pixels: Pixels, background: Color | None) -> PixelLayers:
    """Composite over ``background``; without one, transparent pixels are invalid."""
    rgb, alpha, valid = pixels.rgb, pixels.alpha, None
    if not pixels.from_levels:
        valid = np.isfinite(rgb).all(-1) & (True if alpha is None else np.isfinite(alpha))
        rgb = np.clip(np.nan_to_num(rgb, nan=0.0), 0, 1)
        alpha = None if alpha is None else np.clip(np.nan_to_num(alpha, nan=0.0), 0, 1)
    if alpha is not None and background is None:
        solid = alpha >= _OPAQUE
        valid = solid if valid is None else valid & solid
    elif alpha is not None:
        share = alpha[..., None]
        rgb = rgb * share + np.asarray(background, np.float32) * (1 - share)
    return PixelLayers(rgb=rgb, counts=None if valid is None or valid.all() else valid)


def apply_mask(layers: PixelLayers, mask: Bool[np.ndarray, "h w"]) -> PixelLayers:
    """Restrict the valid pixels to ``mask``."""
    return replace(layers, counts=mask if layers.counts is None else layers.counts & mask)


def undistort(
    layers: PixelLayers, column: Float32[np.ndarray, "h w"], row: Float32[np.ndarray, "h w"]
) -> PixelLayers:
    """Resample ``layers`` at (column, row); pixels from outside are invalid."""
    counts = np.ones(row.shape, bool) if layers.counts is None else layers.counts
    share = cv2.remap(counts.astype(np.float32), column, row, cv2.INTER_LINEAR)
    depth = layers.depth
    if depth is not None:
        depth = cv2.remap(depth, column, row, cv2.INTER_NEAREST)
    rgb = cv2.remap(layers.rgb, column, row, cv2.INTER_LINEAR)
    return PixelLayers(rgb=rgb, counts=share > _MIN_VALID_SHARE, depth=depth)


def downscale(layers: PixelLayers, factor: int) -> PixelLayers:
    """Downscale by blocks of ``factor`` by ``factor`` pixels; incomplete blocks are cut.

    A block is valid if all its pixels are, and its depth is the lower median of valid depths.
    """
    if factor == 1:
        return layers
    counts, depth = layers.counts, layers.depth
    return PixelLayers(
        rgb=pixel_blocks(layers.rgb, factor).mean(2, dtype=np.float32),
        counts=None if counts is None else pixel_blocks(counts, factor).all(2),
        depth=None if depth is None else _median_depth(pixel_blocks(depth, factor)),
    )


def to_frame(layers: PixelLayers) -> Frame:
    """Convert to tensors."""
    counts, depth = layers.counts, layers.depth
    return Frame(
        rgb=torch.from_numpy(np.ascontiguousarray(layers.rgb)),
        counts=None if counts is None or counts.all() else torch.from_numpy(counts),
        depth=None if depth is None else torch.from_numpy(np.ascontiguousarray(depth)),
    )


def pixel_blocks(values: np.ndarray, factor: int) -> np.ndarray:
    """Blocks of ``factor`` by ``factor`` pixels: ``h w ...`` to ``h/n w/n n² ...``."""
    height, width = values.shape[0] // factor, values.shape[1] // factor
    cropped = values[: height * factor, : width * factor]
    split = cropped.reshape(height, factor, width, factor, *values.shape[2:])
    return split.swapaxes(1, 2).reshape(height, width, factor * factor, *values.shape[2:])


def _median_depth(pixel_blocks: Float[np.ndarray, "h w n"]) -> Float32[np.ndarray, "h w"]:
    valid = np.sort(np.where(pixel_blocks > 0, pixel_blocks, np.inf), axis=2)
    count = (pixel_blocks > 0).sum(2)
    middle = np.take_along_axis(valid, np.maximum(count - 1, 0)[..., None] // 2, axis=2)[..., 0]
    return np.where(count > 0, middle, 0).astype(np.float32)

"""Unknown depth filled: sky is far, holes take the depth beside them."""

import cv2
import numpy as np

SKY_SHARE = 0.02
"""Of the image; an unknown region at its upper edge that is larger counts as sky."""


def fill_holes(depth: np.ndarray, far: float) -> np.ndarray:
    """``depth`` (h, w) without NaN and infinity; infinity, and unknown sky, become ``far``."""
    filled = np.where(np.isposinf(depth), np.float32(far), depth)
    unknown = ~np.isfinite(filled)
    if not unknown.any():
        return filled
    sky = _sky(unknown)
    filled[sky] = far
    holes = unknown & ~sky
    if holes.any():
        # The nearest known pixel: the labels of a distance transform are those of its zeros.
        known = (~holes).astype(np.uint8)
        labels = cv2.distanceTransformWithLabels(
            1 - known, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )[1]
        values = np.zeros(labels.max() + 1, dtype=filled.dtype)
        values[labels[known > 0]] = filled[known > 0]
        filled = np.where(holes, values[labels], filled)
    return filled


def _sky(unknown: np.ndarray) -> np.ndarray:
    """Connected unknown regions that reach the upper edge and are large."""
    count, labels = cv2.connectedComponents(unknown.astype(np.uint8))
    sizes = np.bincount(labels.ravel(), minlength=count)
    above = np.setdiff1d(labels[0], [0])
    return np.isin(labels, above[sizes[above] >= SKY_SHARE * unknown.size])

"""Which pixels are still seen in the next frame. Axes: ``h w`` pixels."""

import cv2
import numpy as np
from jaxtyping import Bool

from diff4splat.data_prep.datasets.common.sequence import FlowMap

_ROUND_TRIP_PX, _ROUND_TRIP_SHARE = 1.0, 0.05
"""How far there and back may miss: pixels, and a share of the flow."""


def visible_pixels(forward: FlowMap, backward: FlowMap | None) -> Bool[np.ndarray, "h w"]:
    """Inside the next frame and, where the flow back is known, led back to where it began."""
    if forward.visible is not None:
        return forward.visible & forward.known
    height, width = forward.known.shape
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    offset = np.where(forward.known[..., None], forward.offset_px, 0)
    x = (columns + offset[..., 0]).astype(np.float32)
    y = (rows + offset[..., 1]).astype(np.float32)
    inside = (x >= -0.5) & (x < width - 0.5) & (y >= -0.5) & (y < height - 0.5)
    visible = forward.known & inside
    if backward is None:
        return visible
    back = cv2.remap(backward.offset_px, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    known = cv2.remap(backward.known.astype(np.uint8), x, y, cv2.INTER_NEAREST)
    missed = np.linalg.norm(offset + back, axis=-1)
    most = _ROUND_TRIP_PX + _ROUND_TRIP_SHARE * np.linalg.norm(offset, axis=-1)
    return visible & (known > 0) & (missed <= most)

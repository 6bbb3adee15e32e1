"""Stage 3: brightness, black borders, overlaid text, sharpness and repeated frames.

Text and logos lie over the image: their edges stay at one place while the image moves. That needs
no text detector, but motion; where the image does not move, the score is absent.
"""

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from diff4splat.data_prep.curation.working_clip import WorkingClip

_BLACK, _EDGE = 12, 60.0
_BLOCK_PX = 8
_LEAST_CHANGE = 6.0
"""Mean change of levels from the first to the last frame: less is an image that does not move."""
_REPEATED = 0.35
"""Mean change of levels between two frames that are one frame stored twice."""


def score_exposure(working: WorkingClip) -> WorkingClip:
    """``luma``, ``border_share``, ``overlay_share``, ``sharpness``, ``repeated_share``."""
    grey = np.stack([cv2.cvtColor(i, cv2.COLOR_RGB2GRAY) for i in working.images])
    sharpness = [cv2.Laplacian(each, cv2.CV_32F).var() for each in grey]
    steps = [float(cv2.absdiff(a, b).mean()) for a, b in pairwise(grey)]
    return working.scored(
        luma=float(grey.mean()),
        border_share=border_share(grey),
        overlay_share=overlay_share(grey),
        sharpness=float(np.median(sharpness)),
        repeated_share=float((np.array(steps) < _REPEATED).mean()) if steps else None,
    )


def border_share(grey: UInt8[np.ndarray, "t h w"]) -> float:
    """Share of the area in rows and columns at the edge that are black in every frame."""
    bright = (grey > _BLACK).any(0)
    rows, columns = np.flatnonzero(bright.any(1)), np.flatnonzero(bright.any(0))
    if not len(rows):
        return 1.0
    inside = (rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1)
    return 1 - inside / bright.size


def overlay_share(grey: UInt8[np.ndarray, "t h w"]) -> float | None:
    """Share of the area whose edges stay while the image moves; None where it does not move."""
    if len(grey) < 3 or cv2.absdiff(grey[0], grey[-1]).mean() < _LEAST_CHANGE:
        return None
    lasting = np.min([_gradient(each) for each in grey], axis=0) > _EDGE
    rows, columns = (side // _BLOCK_PX for side in lasting.shape)
    if not rows or not columns:
        return None
    whole = lasting[: rows * _BLOCK_PX, : columns * _BLOCK_PX]
    blocks = whole.reshape(rows, _BLOCK_PX, columns, _BLOCK_PX).mean((1, 3))
    return float((blocks > 0.1).mean())


def _gradient(grey: UInt8[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    return np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)) / 4

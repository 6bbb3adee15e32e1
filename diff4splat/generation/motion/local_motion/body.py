"""Round bodies of objects that turn: depth of a relief as deep as their outline is wide (ours).

Axes: ``y x`` pixels. Predicted relief of an object is far too flat to be looked at from the side.
Its outline says how thick it may be: what is upright is mostly as deep as it is wide, row by row,
so a cone has a tip and a block a flat top. Wide rows are no deeper than the largest circle inside
the outline, as a car is long and not as wide. From the middle of a row the front falls back as an
ellipse.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

LEAST_SHARE = 0.25
"""Depth of the front over that of the middle, at least: what is near is in front of the camera."""


def rounded(
    depth: Float[Tensor, "y x"], inside: Bool[Tensor, "y x"], focal_px: float, rim_px: int
) -> tuple[Float[Tensor, "y x"], float]:
    """Depth of a round body ``inside``, of the same median, and that of the body's middle.

    A rim of ``rim_px`` is as far as the pixels next to it: it must hide what closes the body.
    """
    before_px = _before_px(inside, rim_px).to(depth)
    nearer = (1 - before_px / focal_px).clamp_min(LEAST_SHARE)
    middle = float(depth[inside].median() / nearer[inside].median())
    body = middle * nearer
    return torch.where(inside, body, depth), middle


def _before_px(inside: Bool[Tensor, "y x"], rim_px: int) -> Float[Tensor, "y x"]:
    """How far each pixel is before the middle, at the scale of the image."""
    to_left, to_right = _to_end_px(inside), _to_end_px(inside.flip(1)).flip(1)
    half_width = (to_left + to_right - 1) / 2
    from_end = torch.minimum(to_left, to_right).clamp_min(rim_px + 1) - 0.5
    across = (1 - from_end / half_width).clamp_min(0)
    return half_width.clamp_max(_largest_circle_px(inside)) * (1 - across.square()).sqrt()


def _to_end_px(inside: Bool[Tensor, "y x"]) -> Float[Tensor, "y x"]:
    """Pixels from the left end of a pixel's run within its row, itself included."""
    column = torch.arange(inside.shape[1], device=inside.device).expand(inside.shape)
    last_outside = torch.where(inside, -1, column).cummax(1).values
    return (column - last_outside).clamp_min(1).double()


def _largest_circle_px(inside: Bool[Tensor, "y x"]) -> float:
    """Its radius, inside the outline."""
    # OpenCV takes a tenth of a second to load, which what does not turn need not wait for.
    import cv2

    padded = np.pad(inside.cpu().numpy().astype(np.uint8), 1)
    return float(cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE).max())

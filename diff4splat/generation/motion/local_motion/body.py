"""Round bodies of objects that turn: depth of a relief as deep as their outline is wide (ours).

Axes: ``y x`` pixels. Predicted relief of an object is far too flat to be looked at from the side.
Its outline says how thick it may be, as in Teddy (Igarashi et al. 1999): a pixel is as far before
the object's middle as a ball inside the outline would be.
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
    import cv2

    padded = np.pad(inside.cpu().numpy().astype(np.uint8), 1)
    from_edge = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    from_edge = torch.from_numpy(from_edge).to(depth).clamp_min(rim_px + 1)
    radius = from_edge.max()
    before_px = (radius**2 - (radius - from_edge).square()).clamp_min(0).sqrt()
    nearer = (1 - before_px / focal_px).clamp_min(LEAST_SHARE)
    middle = float(depth[inside].median() / nearer[inside].median())
    body = middle * nearer
    return torch.where(inside, body, depth), middle

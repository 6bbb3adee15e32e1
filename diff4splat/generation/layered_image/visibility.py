"""Which pixels of later key frames show what an earlier one has shown already.

Axes: ``k`` key frames, ``h w`` pixels. A pixel is covered when an earlier key frame sees the same
point: it lies in its picture, at about the depth that it has there. What moves is at another place
in every key frame and stays. Leaving covered pixels out keeps doubled surfaces, which never agree
exactly, from blurring each other.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels

TOLERANCE = 0.08
"""Relative difference of depths that still count as one surface."""


@torch.no_grad()
def visible_in_earlier_frame(
    depth: Float[Tensor, "k h w"], cameras: Camera
) -> Bool[Tensor, "k h w"]:
    """``depth`` is z, above 0; ``cameras`` has batch shape (k,). The first frame has nothing."""
    found = torch.zeros_like(depth, dtype=torch.bool)
    for key in range(1, len(depth)):
        for earlier in range(key):
            found[key] |= _seen_by(depth, cameras, (key, earlier))
    return found


def _seen_by(
    depth: Float[Tensor, "k h w"], cameras: Camera, pair: tuple[int, int]
) -> Bool[Tensor, "h w"]:
    """Pixels of the first key of ``pair`` that the second one shows."""
    own, other = (cameras[slice(key, key + 1)] for key in pair)
    pixels, relative = other_pixels(own, other, 1 / depth[pair[0], None, None])
    there = torch.nn.functional.grid_sample(
        depth[pair[1], None, None], pixels[:, 0], mode="nearest", align_corners=False
    )[0, 0]
    expected = relative[0, 0] * depth[pair[0]]
    agrees = (expected - there).abs() < TOLERANCE * expected
    return inside(pixels, relative)[0, 0] & agrees

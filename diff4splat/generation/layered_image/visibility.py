"""Which pixels of later frames show what an earlier one shows already.

Axes: ``k`` frames, ``h w`` pixels. An earlier frame sees the same point if the point lies in its
image, at about the depth that it has there. Whatever moves is elsewhere in every frame. Leaving
duplicate pixels out keeps two surfaces, which never agree exactly, from blurring each other.
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
    depth: Float[Tensor, "k h w"],
    cameras: Camera,
    counted: Bool[Tensor, "k h w"] | None = None,
) -> Bool[Tensor, "k h w"]:
    """``depth`` is z, above 0; ``cameras`` has batch shape (k,). In the first frame all is false.

    With ``counted``, only those pixels of earlier frames count.
    """
    visible = torch.zeros_like(depth, dtype=torch.bool)
    for key in range(1, len(depth)):
        for earlier in range(key):
            mask = None if counted is None else counted[earlier]
            visible[key] |= _seen_by(depth, cameras, (key, earlier), mask)
    return visible


def _seen_by(
    depth: Float[Tensor, "k h w"],
    cameras: Camera,
    pair: tuple[int, int],
    mask: Bool[Tensor, "h w"] | None,
) -> Bool[Tensor, "h w"]:
    """Pixels of the first frame of ``pair`` that the second one shows, within ``mask``."""
    own, other = (cameras[slice(key, key + 1)] for key in pair)
    pixels, relative = other_pixels(own, other, 1 / depth[pair[0], None, None])
    there = nearest_pixel(depth[pair[1]], pixels)
    expected = relative[0, 0] * depth[pair[0]]
    agrees = (expected - there).abs() < TOLERANCE * expected
    seen = inside(pixels, relative)[0, 0] & agrees
    return seen if mask is None else seen & (nearest_pixel(mask.to(depth), pixels) > 0.5)


def nearest_pixel(
    image: Float[Tensor, "h w"], pixels: Float[Tensor, "1 1 h w 2"]
) -> Float[Tensor, "h w"]:
    """The image at normalised places, without interpolation; 0 outside."""
    return torch.nn.functional.grid_sample(
        image[None, None], pixels[:, 0], mode="nearest", align_corners=False
    )[0, 0]

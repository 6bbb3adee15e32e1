"""Things go as wholes: what moves and touches has one way and one depth (ours; docs/adr/0025).

Axes: ``t`` latent frames, ``h w`` pixels of the picture that networks see, ``hc wc`` its cells. The
motion of a thing is told cell by cell, its depth pixel by pixel, and neither agrees exactly with
itself: things would tear as they go. What turns, wobbles or bends stays where it is: the mean of
its ways is short, and no sign that it goes anywhere.
"""

import cv2
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.models.motion_unet.motion_field import UNIT, masked_offsets, upsample_to_pixels

MIN_RELATIVE_DISPLACEMENT = 0.1
"""Of its depth; a thing that is told to go less far stands. Things go 0.24 of it, as a rule."""


def rigid_component_offsets(
    field: Float[Tensor, "3 t hc wc"],
    moving: Bool[Tensor, "h w"],
    depth: Float[Tensor, "h w"],
) -> Float[Tensor, "t h w 3"]:
    """How far every pixel has gone at the time of every latent frame, in scene units.

    The ``moving`` pixels of a thing go by the mean of its ways at the median of its ``depth``, or
    all stand.
    """
    ways, place, thing = upsample_to_pixels(field), depth.clone(), connected_components(moving)
    for number in range(1, int(thing.max()) + 1):
        own = thing == number
        way = ways[:, :, own].mean(-1, keepdim=True)
        far = way.norm(dim=1).max() * UNIT >= MIN_RELATIVE_DISPLACEMENT
        ways[:, :, own] = way * far
        place[own] = depth[own].median()
    return masked_offsets(ways, moving, place)


def connected_components(moving: Bool[Tensor, "h w"]) -> Int[Tensor, "h w"]:
    """Number of the thing that a pixel belongs to, 0 for what stands; corners touch too."""
    mask = moving.to(device="cpu", dtype=torch.uint8).numpy()
    number = cv2.connectedComponents(mask, connectivity=8)[1]
    return torch.from_numpy(number).to(device=moving.device, dtype=torch.int64)

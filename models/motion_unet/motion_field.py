"""The motion of what the first frame shows (ours; docs/adr/0018).

Axes: ``t`` latent frames, ``c`` = 3, ``hc wc`` cells of 4 pixels, ``hh ww`` pixels. Per latent
frame and cell the motion is the mean of

    (position at the last time of the latent frame − position in the first frame) / depth / UNIT

along the axes of the first camera. In the first latent frame it is 0.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.config.networks import MOTION_CELL_PX

UNIT = 0.08
"""Relative displacement at which a motion is 1: a third of the usual, which thus exceeds noise."""


def upsample_to_pixels(field: Float[Tensor, "c t hc wc"]) -> Float[Tensor, "t c hh ww"]:
    """A smooth ``field`` of cells at every pixel."""
    return torch.nn.functional.interpolate(
        field.transpose(0, 1), scale_factor=MOTION_CELL_PX, mode="bilinear", align_corners=False
    )


def masked_offsets(
    motion: Float[Tensor, "t c hh ww"],
    mask: Bool[Tensor, "hh ww"] | Float[Tensor, "hh ww"],
    depth: Float[Tensor, "hh ww"],
) -> Float[Tensor, "t hh ww 3"]:
    """Displacement of pixels in scene units: their ``motion`` within the ``mask``."""
    return (motion * mask).movedim(1, -1) * UNIT * depth[..., None]

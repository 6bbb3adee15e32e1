"""Displacement of what the first frame shows, as the motion prior predicts it (ours; ADR 18).

Axes: ``t`` latent frames, ``c`` = 3, ``hc wc`` cells of 4 pixels, ``hh ww`` pixels. Per latent
frame and cell the mean of

    (position at the last time of the latent frame − position in the first frame) / depth / UNIT

along the axes of the first camera. It is 0 in the first latent frame.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.config.networks import MOTION_CELL_PX

UNIT = 0.08
"""Displacement over depth that is 1 in a field: a third of a typical one, large against noise."""


def upsample_to_pixels(field: Float[Tensor, "c t hc wc"]) -> Float[Tensor, "t c hh ww"]:
    """A smooth ``field`` of cells at every pixel."""
    return torch.nn.functional.interpolate(
        field.transpose(0, 1), scale_factor=MOTION_CELL_PX, mode="bilinear", align_corners=False
    )


def masked_offsets(
    field: Float[Tensor, "t c hh ww"],
    mask: Bool[Tensor, "hh ww"] | Float[Tensor, "hh ww"],
    depth: Float[Tensor, "hh ww"],
) -> Float[Tensor, "t hh ww 3"]:
    """Displacement of every pixel in scene units, 0 outside ``mask``; ``depth`` is z."""
    return (field * mask).movedim(1, -1) * UNIT * depth[..., None]

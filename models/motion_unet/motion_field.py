"""Motion beside the latents: where what the first frame shows goes to (ours; docs/adr/0018).

Axes: ``b`` batch, ``m`` motion channels, ``t h w`` latent grid, ``c`` = 3, ``hc wc`` cells of 4
pixels, ``hh ww`` pixels. Per latent frame and cell the mean of

    (position at the last time of the latent frame − position in the first frame) / depth / UNIT

along the axes of the first camera. The cells of one latent pixel are channels, so that a motion has
the grid of the latents. In the first latent frame it is 0.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.blocks.bilateral_upsampling import bilateral_upsample, log_weights
from diff4splat.models.config.networks import MOTION_CELL_PX

UNIT = 0.08
"""What is 1 in a motion: about a third of how far things go, so that noise is small beside that."""


def pack_motion(
    cells: Float[Tensor, "b c t hc wc"], space_stride: int
) -> Float[Tensor, "b m t h w"]:
    """Cells as channels of latent pixels of ``space_stride`` pixels per side."""
    factor = space_stride // MOTION_CELL_PX
    rows = torch.nn.functional.pixel_unshuffle(cells.transpose(1, 2), factor)
    return rows.transpose(1, 2)


def unpack_motion(motion: Float[Tensor, "b m t h w"]) -> Float[Tensor, "b c t hc wc"]:
    """The inverse of ``pack_motion``."""
    factor = round((motion.shape[1] / 3) ** 0.5)
    return torch.nn.functional.pixel_shuffle(motion.transpose(1, 2), factor).transpose(1, 2)


def append_zero_motion(
    latent: Float[Tensor, "b c t h w"], channels: int
) -> Float[Tensor, "b d t h w"]:
    """A latent with ``channels`` more that say: nothing has moved."""
    if channels == 0:
        return latent
    still = latent.new_zeros(len(latent), channels, *latent.shape[2:])
    return torch.cat([latent, still], 1)


def decode_offsets(
    motion: Float[Tensor, "1 m t h w"],
    rgb: Float[Tensor, "hh ww 3"],
    depth: Float[Tensor, "hh ww"],
) -> Float[Tensor, "t hh ww 3"]:
    """How far every pixel's point has gone at the time of every latent frame, in scene units.

    Motion keeps to edges of colour in the first picture ``rgb``; ``depth`` is z of its pixels.
    """
    cells = unpack_motion(motion)[0]
    colors = torch.nn.functional.avg_pool2d(rgb.movedim(-1, 0)[None], MOTION_CELL_PX)[0]
    weight = log_weights(colors.movedim(0, -1), rgb)
    fields = [bilateral_upsample(cells[:, time], weight) for time in range(cells.shape[1])]
    return torch.stack(fields).movedim(1, -1) * UNIT * depth[..., None]


def upsample_to_pixels(field: Float[Tensor, "c t hc wc"]) -> Float[Tensor, "t c hh ww"]:
    """A smooth ``field`` of cells at every pixel."""
    return torch.nn.functional.interpolate(
        field.transpose(0, 1), scale_factor=MOTION_CELL_PX, mode="bilinear", align_corners=False
    )


def masked_offsets(
    ways: Float[Tensor, "t c hh ww"],
    moves: Bool[Tensor, "hh ww"] | Float[Tensor, "hh ww"],
    depth: Float[Tensor, "hh ww"],
) -> Float[Tensor, "t hh ww 3"]:
    """How far pixels have gone: by their ``ways``, where something ``moves``."""
    return (ways * moves).movedim(1, -1) * UNIT * depth[..., None]

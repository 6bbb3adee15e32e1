"""Images that were smaller: a network then knows enlarged ones, too.

Axes: ``n`` images, ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.training.batches.clip_batch import ClipBatch


def with_coarse_images(batch: ClipBatch, side_px: int) -> ClipBatch:
    """The batch with the video reduced to ``side_px`` in width and enlarged again.

    Everything else stays: the network is to find the edges of what moves in a soft image.

    Raises:
        ShapeError: the images are no whole multiple of it.
    """
    height, width = batch.video.shape[2:4]
    factor = width // side_px
    if width != factor * side_px or height % factor:
        raise ShapeError(
            f"view side: expected a divisor of {height} x {width} px, got {side_px}; "
            "correct data.view_sides_px"
        )
    return batch if factor == 1 else replace(batch, video=_coarse(batch.video, factor))


def _coarse(images: UInt8[Tensor, "*n h w 3"], factor: int) -> UInt8[Tensor, "*n h w 3"]:
    flat = images.flatten(0, -4).movedim(-1, 1).float()
    small = torch.nn.functional.avg_pool2d(flat, factor)
    large = torch.nn.functional.interpolate(
        small, scale_factor=factor, mode="bicubic", align_corners=False
    )
    rounded = large.clamp(0, 255).round().to(torch.uint8)
    return rounded.movedim(1, -1).unflatten(0, images.shape[:-3])

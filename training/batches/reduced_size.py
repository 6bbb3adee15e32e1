"""A batch at a smaller size: networks learn more than one scale from one clip.

Axes: ``n`` images, ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.training.batches.clip_batch import ClipBatch


def reduced(batch: ClipBatch, side_px: int) -> ClipBatch:
    """The batch with images ``side_px`` wide.

    A pixel moves if at least half of what it averages does. Cells are averaged: those without
    motion have been extended from the nearest with some. Depth is that of one pixel each.

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
    if factor == 1:
        return batch
    size_px = (height // factor, width // factor)
    share = torch.nn.functional.avg_pool2d(batch.moving.float()[:, None], factor)[:, 0]
    field = torch.nn.functional.avg_pool2d(batch.field.flatten(1, 2), factor)
    return replace(
        batch,
        video=_means(batch.video, factor),
        cameras=batch.cameras.resized(size_px),
        depth=batch.depth[..., ::factor, ::factor],
        target_rgb=_means(batch.target_rgb, factor),
        target_depth=batch.target_depth[..., ::factor, ::factor],
        target_cameras=batch.target_cameras.resized(size_px),
        track_cell=batch.track_cell // batch.track_cell.new_tensor([1, factor, factor]),
        field=field.unflatten(1, batch.field.shape[1:3]),
        moving=share >= 0.5,
    )


def _means(images: UInt8[Tensor, "*n h w 3"], factor: int) -> UInt8[Tensor, "*n h2 w2 3"]:
    flat = images.flatten(0, -4).movedim(-1, 1).float()
    small = torch.nn.functional.avg_pool2d(flat, factor).round().to(torch.uint8)
    return small.movedim(1, -1).unflatten(0, images.shape[:-3])

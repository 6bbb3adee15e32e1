"""Images that were smaller, and batches enlarged to the size that a network sees.

Axes: ``n`` images, ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import Float, Shaped, UInt8
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
    return batch if factor == 1 else replace(batch, video=coarse(batch.video, factor))


def enlarged(batch: ClipBatch, factor: int) -> ClipBatch:
    """The batch with ``factor`` times the sides: images and motion interpolated, the rest repeated.

    A track stays on the upper left cell of those that its own becomes.
    """
    if factor == 1:
        return batch
    height, width = batch.video.shape[2:4]
    size_px = (factor * height, factor * width)
    field = torch.nn.functional.interpolate(
        batch.field.flatten(0, 1), scale_factor=factor, mode="bilinear", align_corners=False
    )
    return replace(
        batch,
        video=_larger(batch.video, factor),
        cameras=batch.cameras.resized(size_px),
        depth=_repeated(batch.depth, factor),
        target_rgb=_larger(batch.target_rgb, factor),
        target_depth=_repeated(batch.target_depth, factor),
        target_cameras=batch.target_cameras.resized(size_px),
        track_cell=batch.track_cell * batch.track_cell.new_tensor([1, factor, factor]),
        field=field.unflatten(0, batch.field.shape[:2]),
        moving=_repeated(batch.moving, factor),
    )


def _larger(images: UInt8[Tensor, "*n h w 3"], factor: int) -> UInt8[Tensor, "*n h2 w2 3"]:
    flat = images.flatten(0, -4).movedim(-1, 1).float()
    return _pixels(_bicubic(flat, factor)).unflatten(0, images.shape[:-3])


def _repeated(maps: Shaped[Tensor, "*n h w"], factor: int) -> Shaped[Tensor, "*n h2 w2"]:
    return maps.repeat_interleave(factor, -2).repeat_interleave(factor, -1)


def coarse(images: UInt8[Tensor, "*n h w 3"], factor: int) -> UInt8[Tensor, "*n h w 3"]:
    """Reduced by ``factor`` and enlarged again."""
    flat = images.flatten(0, -4).movedim(-1, 1).float()
    small = torch.nn.functional.avg_pool2d(flat, factor)
    return _pixels(_bicubic(small, factor)).unflatten(0, images.shape[:-3])


def _bicubic(images: Float[Tensor, "n 3 h w"], factor: int) -> Float[Tensor, "n 3 h2 w2"]:
    return torch.nn.functional.interpolate(
        images, scale_factor=factor, mode="bicubic", align_corners=False
    )


def _pixels(images: Float[Tensor, "n 3 h w"]) -> UInt8[Tensor, "n h w 3"]:
    return images.clamp(0, 255).round().to(torch.uint8).movedim(1, -1)

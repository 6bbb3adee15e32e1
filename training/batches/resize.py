"""A clip at another image size.

Axes: ``f`` frames, ``h w`` pixels before, ``h2 w2`` after.
"""

from dataclasses import replace

import cv2
import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.data.view_labels import edited_labels
from diff4splat.errors import InputError
from diff4splat.training.batches.augment import cut_out

SAME_SHAPE = 1.1
"""Greatest change of width over height that is taken for rounding."""


def resized(clip: Clip, size_px: tuple[int, int]) -> Clip:
    """The clip at another (height, width): colour by area, depth and masks by nearest pixel.

    Raises:
        InputError: the shape of the image would change by more than a tenth.
    """
    if clip.size_px == size_px:
        return clip
    if not _same_shape(clip.size_px, size_px):
        (height, width), (new_height, new_width) = clip.size_px, size_px
        raise InputError(
            f"clip {clip.note.identifier}: expected images of the shape "
            f"{new_height}×{new_width}, got {height}×{width}; prepare the clips at that shape"
        )
    return replace(clip, views=tuple(_resized_view(view, size_px) for view in clip.views))


def fitted(clip: Clip, size_px: tuple[int, int]) -> Clip:
    """The same of a clip of any shape: the middle of other shapes is cut out first."""
    if _same_shape(clip.size_px, size_px):
        return resized(clip, size_px)
    share = min(old / new for old, new in zip(clip.size_px, size_px, strict=True))
    height, width = (max(round(side * share), 1) for side in size_px)
    corner = (clip.size_px[0] - height) // 2, (clip.size_px[1] - width) // 2
    part = cut_out(clip, corner, (height, width))
    return replace(part, views=tuple(_resized_view(view, size_px) for view in part.views))


def _same_shape(size_px: tuple[int, int], wanted_px: tuple[int, int]) -> bool:
    change = (size_px[1] / size_px[0]) / (wanted_px[1] / wanted_px[0])
    return 1 / SAME_SHAPE < change < SAME_SHAPE


def _resized_view(view: View, size_px: tuple[int, int]) -> View:
    height, width = view.cameras.size_px
    rows = ((torch.arange(size_px[0]) + 0.5) * height / size_px[0]).long()
    columns = ((torch.arange(size_px[1]) + 0.5) * width / size_px[1]).long()
    uv = view.track_uv
    if uv is not None:
        uv = uv * uv.new_tensor([size_px[1] / width, size_px[0] / height])
    return replace(
        view,
        **edited_labels(view, lambda label: label[:, rows][:, :, columns]),
        rgb=_shrunk(view.rgb, size_px),
        cameras=view.cameras.resized(size_px),
        flow=None,
        track_uv=uv,
    )


def _shrunk(rgb: UInt8[Tensor, "f h w 3"], size_px: tuple[int, int]) -> UInt8[Tensor, "f h2 w2 3"]:
    frames = [
        cv2.resize(frame, size_px[::-1], interpolation=cv2.INTER_AREA) for frame in rgb.numpy()
    ]
    return torch.stack([torch.from_numpy(frame) for frame in frames])

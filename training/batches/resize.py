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


def resized(clip: Clip, size_px: tuple[int, int]) -> Clip:
    """The clip at another (height, width): colour by area, depth and masks by nearest pixel.

    Raises:
        InputError: the shape of the image would change by more than a tenth.
    """
    if clip.size_px == size_px:
        return clip
    (height, width), (new_height, new_width) = clip.size_px, size_px
    if not 0.9 < (width / height) / (new_width / new_height) < 1.1:
        raise InputError(
            f"clip {clip.note.identifier}: expected images of the shape "
            f"{new_height}×{new_width}, got {height}×{width}; prepare the clips at that shape"
        )
    return replace(clip, views=tuple(_resized_view(view, size_px) for view in clip.views))


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

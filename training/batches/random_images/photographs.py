"""Photographs without depth, kept in memory as squares.

Axes: ``n`` photographs, ``s`` their side in pixels.
"""

from pathlib import Path

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from diff4splat.io.photos.find import find_photographs
from diff4splat.io.photos.images import read_photo
from diff4splat.io.pixels import to_bytes


def read_photographs(folder: Path, side_px: int) -> UInt8[Tensor, "n 3 s s"]:
    """The middle square of every photograph in ``folder``, by name.

    Raises:
        InputError: the folder has no photographs, or one cannot be read.
    """
    files = find_photographs(folder, "data.photographs or leave it out")
    squares = (middle_square(read_photo(file, convert=True).rgb, side_px) for file in files)
    return torch.stack([torch.from_numpy(to_bytes(square)) for square in squares])


def middle_square(rgb: Float[Tensor, "h w 3"], side_px: int) -> Float[Tensor, "3 s s"]:
    """The largest square in the middle of an image, resized."""
    short = min(rgb.shape[:2])
    top, left = ((length - short) // 2 for length in rgb.shape[:2])
    square = rgb[top : top + short, left : left + short].movedim(-1, 0)
    return torch.nn.functional.interpolate(
        square[None], (side_px, side_px), mode="bilinear", antialias=True
    )[0].clamp(0, 1)

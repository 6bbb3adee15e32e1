"""Cutouts, images of one object with transparency, kept in memory as squares.

Axes: ``m`` cutouts, ``s`` their side in pixels, ``h w`` pixels of a file.
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float32, UInt8
from torch import Tensor

from diff4splat.data_prep.cutouts.cutout import find_images, read_rgba
from diff4splat.errors import InputError

SIDE_PX, MOST_CUTOUTS = 128, 3000


def read_cutouts(folder: Path) -> UInt8[Tensor, "m 4 s s"]:
    """Images with transparency in ``folder``, their objects on the lower edge of squares.

    Raises:
        InputError: the folder has none.
        FileFormatError: one is damaged, without transparency, or wholly transparent.
    """
    files = find_images(folder)
    if not files:
        raise InputError(
            f"{folder}: expected PNG or WebP images with transparency, got none; "
            "name another folder as data.cutouts or leave it out"
        )
    chosen = files[:: -(-len(files) // MOST_CUTOUTS)]
    return torch.stack([_square(read_rgba(file)) for file in chosen])


def _square(rgba: Float32[np.ndarray, "h w 4"]) -> UInt8[Tensor, "4 s s"]:
    """In the middle of the lower edge; colours continue where nothing is opaque."""
    pixels = torch.from_numpy(rgba).movedim(-1, 0)
    color, alpha = pixels[:3], pixels[3:]
    mean = (color * alpha).sum((1, 2)) / alpha.sum().clamp_min(1e-6)
    color = torch.where(alpha > 0, color, mean[:, None, None])
    height, width = rgba.shape[:2]
    side = max(height, width)
    square = torch.cat([mean, mean.new_zeros(1)])[:, None, None].repeat(1, side, side)
    left = (side - width) // 2
    square[:, side - height :, left : left + width] = torch.cat([color, alpha])
    small = torch.nn.functional.interpolate(
        square[None], (SIDE_PX, SIDE_PX), mode="bilinear", antialias=True
    )[0]
    return (255 * small.clamp(0, 1)).round().to(torch.uint8)

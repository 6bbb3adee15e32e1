"""Rows or columns of a sensor, and when they are read.

Axes: ``l`` lines, ``p`` pixels (flat indices, row by row). Line r of H is read at r / (H − 1) of
the read-out, at (H − 1 − r) / (H − 1) in the reverse directions, and a lone line in the middle.
Pixels are identified by their index, so the order of reading cannot misplace them.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.optics import Direction

_BY_ROW = ("top-to-bottom", "bottom-to-top")


def line_count(size_px: tuple[int, int], direction: Direction) -> int:
    """Rows or columns, whichever are read one after another."""
    return size_px[0] if direction in _BY_ROW else size_px[1]


def line_shares(count: int, direction: Direction) -> Float[Tensor, " l"]:
    """Share of the read-out that is over when each line is read, in [0, 1]; float64."""
    if count == 1:
        return torch.tensor([0.5], dtype=torch.float64)
    shares = torch.arange(count, dtype=torch.float64) / (count - 1)
    return shares if direction in ("top-to-bottom", "left-to-right") else shares.flip(0)


def line_of(
    pixels: Int[Tensor, " p"], size_px: tuple[int, int], direction: Direction
) -> Int[Tensor, " p"]:
    """The line that each pixel lies on."""
    width = size_px[1]
    return pixels // width if direction in _BY_ROW else pixels % width

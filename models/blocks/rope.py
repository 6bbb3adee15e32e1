"""Rotary positions over frames, rows and columns (arXiv 2104.09864; channel split of Wan 2.1).

Axes: ``b`` batch, ``n`` tokens of a grid in (t, h, w) order, ``p`` pairs of head channels, ``d``
head width. Channels (2 p, 2 p + 1) turn by position · 10000^(−2 p_axis / d_axis). Rows and columns
have 2 ⌊d/6⌋ channels each and frames the rest. Real arithmetic only: complex tensors cannot be
exported to ONNX.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

BASE = 10000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RopeTables:
    """Cosines and sines of every token's angles, always in float32 or wider."""

    cos: Float[Tensor, "n p"]
    sin: Float[Tensor, "n p"]


def axis_widths(head_width: int) -> tuple[int, int, int]:
    """Head channels that carry frame, row and column: 44, 42, 42 of 128."""
    side = 2 * (head_width // 6)
    return head_width - 2 * side, side, side


def rope_tables(grid: tuple[int, int, int], head_width: int, device: torch.device) -> RopeTables:
    """Tables of a (frames, rows, columns) grid with integer positions."""
    angles = []
    for axis, width in enumerate(axis_widths(head_width)):
        exponent = torch.arange(0, width, 2, dtype=torch.float32, device=device) / width
        position = torch.arange(grid[axis], dtype=torch.float32, device=device)
        # Multiplication, not einsum: automatic mixed precision must leave the angles alone.
        angle = position[:, None] * (BASE**-exponent)
        shape = [1, 1, 1, width // 2]
        shape[axis] = grid[axis]
        angles.append(angle.reshape(shape).expand(*grid, -1))
    flat = torch.cat(angles, -1).flatten(0, 2)
    return RopeTables(cos=flat.cos(), sin=flat.sin())


def rotate(heads: Float[Tensor, "b n h d"], tables: RopeTables) -> Float[Tensor, "b n h d"]:
    """Turn the channel pairs of queries or keys by their tokens' angles."""
    even, odd = heads.unflatten(-1, (-1, 2)).unbind(-1)
    # The tables keep their dtype: half-precision heads are turned in float32 and rounded once.
    cos, sin = tables.cos[:, None], tables.sin[:, None]
    turned = torch.stack([even * cos - odd * sin, even * sin + odd * cos], -1)
    return turned.flatten(-2).to(heads.dtype)

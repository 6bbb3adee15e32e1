"""Depth between pixel centres. Axes: ``n`` places, ``h w`` pixels; ``uv`` is (x, y) in pixels.

1/z is linear in the picture on every plane, so depth is interpolated by its inverse.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

_SAME_SURFACE = 1.05
"""Largest ratio among four neighbours; more is an edge, between whose sides nothing lies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampled:
    """Depth around some places."""

    depth: Float[Tensor, " n"]
    """Between the four nearest centres; 1 where not ``smooth``."""
    smooth: Bool[Tensor, " n"]
    """The four are inside the picture and of one surface."""
    corners: Float[Tensor, "n 4"]
    """Depth at the four centres, 0 outside the picture."""


def sample(depth: Float[Tensor, "h w"], uv: Float[Tensor, "n 2"]) -> Sampled:
    """Look up depth around ``uv``, wherever that is."""
    height, width = depth.shape
    limit = torch.tensor([width, height], dtype=uv.dtype)
    # Whatever is no place at all is outside too.
    place = (uv - 0.5).nan_to_num(nan=-2).maximum(torch.full_like(limit, -2)).minimum(limit + 1)
    low = place.floor()
    part = place - low
    # A frame of zeros around the picture makes what is outside look like what has no depth.
    framed = torch.nn.functional.pad(depth, (2, 3, 2, 3))
    column, row = (low.long() + 2).unbind(-1)
    corners = torch.stack(
        [framed[row + down, column + right] for down in (0, 1) for right in (0, 1)], -1
    )
    right, down = part.unbind(-1)
    weights = torch.stack(
        [(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down], -1
    )
    smooth = (corners > 0).all(-1) & (corners.amax(-1) < _SAME_SURFACE * corners.amin(-1))
    safe = torch.where(smooth[:, None], corners, 1.0)
    return Sampled(depth=1 / (weights / safe).sum(-1), smooth=smooth, corners=corners)

"""Interpolated depth. Axes: ``n`` points, ``h w`` pixels; ``uv`` is (x, y) in pixels.

On a plane, 1/z is linear in pixel coordinates, so inverse depth is interpolated.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

_SAME_SURFACE = 1.05
"""Largest depth ratio of four neighbours on one surface; more is an edge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampled:
    """Interpolated depth at points."""

    depth: Float[Tensor, " n"]
    """Interpolated from the four nearest centres; 1 where not ``smooth``."""
    smooth: Bool[Tensor, " n"]
    """Whether all four are inside the image and on one surface."""
    corners: Float[Tensor, "n 4"]
    """Depth at the four centres; 0 outside the image."""


def sample(depth: Float[Tensor, "h w"], uv: Float[Tensor, "n 2"]) -> Sampled:
    """Interpolate depth at ``uv``, inside or outside the image."""
    height, width = depth.shape
    limit = torch.tensor([width, height], dtype=uv.dtype)
    # NaN counts as outside.
    point = (uv - 0.5).nan_to_num(nan=-2).maximum(torch.full_like(limit, -2)).minimum(limit + 1)
    low = point.floor()
    part = point - low
    # Zero padding makes points outside equal to points without depth.
    padded = torch.nn.functional.pad(depth, (2, 3, 2, 3))
    column, row = (low.long() + 2).unbind(-1)
    corners = torch.stack(
        [padded[row + down, column + right] for down in (0, 1) for right in (0, 1)], -1
    )
    right, down = part.unbind(-1)
    weights = torch.stack(
        [(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down], -1
    )
    smooth = (corners > 0).all(-1) & (corners.amax(-1) < _SAME_SURFACE * corners.amin(-1))
    safe = torch.where(smooth[:, None], corners, 1.0)
    return Sampled(depth=1 / (weights / safe).sum(-1), smooth=smooth, corners=corners)

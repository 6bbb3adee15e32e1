"""A map on the grid of another camera at the same place, and the size of a smaller copy.

Axes: ``h w`` cells of the map, ``y x`` cells of the other grid, ``c`` channels.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import grid_sample

from diff4splat.geometry.camera import Camera


def copy_size(size_px: tuple[int, int], most_side_px: int) -> tuple[int, int]:
    """The same shape with at most that along the longer side."""
    scale = min(most_side_px / max(size_px), 1)
    height, width = (max(round(side * scale), 1) for side in size_px)
    return height, width


def on_grid(
    maps: Float[Tensor, "c h w"], source: Camera, target: Camera
) -> tuple[Float[Tensor, "c y x"], Bool[Tensor, "y x"]]:
    """The maps of ``source`` at the middles of the cells of ``target``, and where they are."""
    axes = [_along(axis, source, target) for axis in (0, 1)]
    across, down = torch.meshgrid(*axes, indexing="xy")
    at = torch.stack([across, down], -1)[None]
    found = grid_sample(maps[None], at, padding_mode="border", align_corners=False)[0]
    return found, (across.abs() < 1) & (down.abs() < 1)


def _along(axis: int, source: Camera, target: Camera) -> Float[Tensor, " n"]:
    """Where cells of ``target`` lie in ``source`` along x or y: from −1 to 1, border to border."""
    count, side = target.size_px[1 - axis], source.size_px[1 - axis]
    cells = torch.arange(count, device=target.focal_px.device, dtype=target.focal_px.dtype) + 0.5
    rays = (cells - target.center_px[axis]) / target.focal_px[axis]
    return 2 * (rays * source.focal_px[axis] + source.center_px[axis]) / side - 1

"""Pixels to points and back through any lens.

Axes: ``h w`` pixels, ``p`` points. Depth is z, 0 for "nothing there".
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.physical_camera import PhysicalCamera

_LEAST_Z = 1e-3
"""Of a unit direction whose depth says how far away something is."""


@torch.no_grad()
def lifted(
    camera: PhysicalCamera, depth: Float[Tensor, "h w"]
) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
    """World points at ``depth``, and where there are any."""
    own = camera.camera.to(depth.dtype)
    height, width = own.size_px
    rows = torch.arange(height, dtype=depth.dtype) + 0.5
    columns = torch.arange(width, dtype=depth.dtype) + 0.5
    pixels = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1)
    lens = camera.optics.lens.to(depth.dtype)
    directions, exist = lens.directions((pixels - own.center_px) / own.focal_px)
    z = directions[..., 2]
    known = exist & (depth > 0) & (z > _LEAST_Z)
    local = directions * (depth / torch.where(known, z, 1.0))[..., None]
    return rigid.transform_points(own.world_from_camera, local.flatten(0, 1)).view_as(local), known


@torch.no_grad()
def fallen(
    camera: PhysicalCamera, points: Float[Tensor, "p 3"]
) -> tuple[Float[Tensor, "p 2"], Bool[Tensor, " p"]]:
    """Pixel coordinates of world points, and which of them lie in the picture."""
    own = camera.camera.to(points.dtype)
    local = rigid.transform_points(own.camera_from_world, points)
    plane, exist = camera.optics.lens.to(points.dtype).points(local)
    pixels = plane * own.focal_px + own.center_px
    height, width = own.size_px
    inside = (pixels >= 0).all(-1) & (pixels < pixels.new_tensor([width, height])).all(-1)
    return pixels, exist & inside

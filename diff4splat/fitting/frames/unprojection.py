"""Pixels to world points and back, through any lens.

Axes: ``h w`` pixels, ``p`` points. Depth is z in scene units; 0 means no depth.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.physical_camera import PhysicalCamera

_MIN_Z = 1e-3
"""Smallest z of a unit direction for which a depth determines a distance."""


@torch.no_grad()
def unproject(
    camera: PhysicalCamera, depth: Float[Tensor, "h w"]
) -> tuple[Float[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
    """World points at ``depth``, and the mask of valid points."""
    pinhole = camera.camera.to(depth.dtype)
    height, width = pinhole.size_px
    rows = torch.arange(height, dtype=depth.dtype) + 0.5
    columns = torch.arange(width, dtype=depth.dtype) + 0.5
    pixels = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1)
    lens = camera.optics.lens.to(depth.dtype)
    directions, exist = lens.directions((pixels - pinhole.center_px) / pinhole.focal_px)
    z = directions[..., 2]
    valid = exist & (depth > 0) & (z > _MIN_Z)
    local = directions * (depth / torch.where(valid, z, 1.0))[..., None]
    points = rigid.transform_points(pinhole.world_from_camera, local.flatten(0, 1))
    return points.view_as(local), valid


@torch.no_grad()
def project(
    camera: PhysicalCamera, points: Float[Tensor, "p 3"]
) -> tuple[Float[Tensor, "p 2"], Bool[Tensor, " p"]]:
    """Pixel coordinates (x, y) of world points, and the mask of points inside the image."""
    pinhole = camera.camera.to(points.dtype)
    local = rigid.transform_points(pinhole.camera_from_world, points)
    plane, exist = camera.optics.lens.to(points.dtype).points(local)
    pixels = plane * pinhole.focal_px + pinhole.center_px
    height, width = pinhole.size_px
    inside = (pixels >= 0).all(-1) & (pixels < pixels.new_tensor([width, height])).all(-1)
    return pixels, exist & inside

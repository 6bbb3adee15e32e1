"""Pixel rays and Plücker maps.

Axes: ``*b`` batch, ``h w`` pixels. The Plücker map holds (moment, direction) = (o × d, d) with a
unit direction d and the camera centre o, in that order (CameraCtrl, arXiv 2404.02101, eq. 3).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera


def pixel_centers(size_px: tuple[int, int], like: Float[Tensor, "..."]) -> Float[Tensor, "h w 2"]:
    """(x, y) of every pixel centre, in the dtype and on the device of ``like``."""
    height, width = size_px
    rows = torch.arange(height, dtype=like.dtype, device=like.device) + 0.5
    columns = torch.arange(width, dtype=like.dtype, device=like.device) + 0.5
    return torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1)


def camera_rays(camera: Camera) -> Float[Tensor, "*b h w 3"]:
    """Ray directions in camera space with z = 1, one per pixel centre."""
    pixels = pixel_centers(camera.size_px, camera.focal_px)
    lead = (..., None, None, slice(None))
    flat = (pixels - camera.center_px[lead]) / camera.focal_px[lead]
    return torch.cat([flat, torch.ones_like(flat[..., :1])], -1)


def world_rays(camera: Camera) -> tuple[Float[Tensor, "*b h w 3"], Float[Tensor, "*b h w 3"]]:
    """Origins and unit directions in world space, one per pixel centre."""
    directions = torch.nn.functional.normalize(camera_rays(camera), dim=-1)
    rotation = camera.world_from_camera[..., None, :3, :3]
    directions = directions @ rotation.mT
    origins = camera.position[..., None, None, :].expand_as(directions)
    return origins, directions


def plucker_map(camera: Camera) -> Float[Tensor, "*b 6 h w"]:
    """(o × d, d) per pixel, channels first."""
    origins, directions = world_rays(camera)
    moments = torch.linalg.cross(origins, directions, dim=-1)
    return torch.cat([moments, directions], -1).movedim(-1, -3)


def relative_to_first(camera: Camera) -> Camera:
    """The same path seen from its first camera, which becomes the identity."""
    first_from_world = rigid.invert(camera.world_from_camera[:1])
    return camera.with_pose(first_from_world @ camera.world_from_camera)

"""Depth maps. Depth is z in camera space; ray distance is measured along the unit ray.

Axes: ``*b`` batch, ``h w`` pixels.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays


def unproject(camera: Camera, depth: Float[Tensor, "*b h w"]) -> Float[Tensor, "*b h w 3"]:
    """World points that a z-depth map puts behind the pixel centres."""
    local = camera_rays(camera) * depth[..., None]
    rotation = camera.world_from_camera[..., None, :3, :3]
    return local @ rotation.mT + camera.position[..., None, None, :]


def distance_from_depth(camera: Camera, depth: Float[Tensor, "*b h w"]) -> Float[Tensor, "*b h w"]:
    """Ray distance of a z-depth map."""
    return depth * camera_rays(camera).norm(dim=-1)


def depth_from_distance(
    camera: Camera, distance: Float[Tensor, "*b h w"]
) -> Float[Tensor, "*b h w"]:
    """z-depth of a ray-distance map."""
    return distance / camera_rays(camera).norm(dim=-1)

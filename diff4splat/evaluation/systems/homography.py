"""Warp an image on a plane to another camera.

Axes: ``h w`` pixels. The plane is z = depth of the source camera. A point X of the source camera's
space lies on it when n·X = depth with n = (0, 0, 1), so for a target with source_from_target
rotation R and position c the ray K_t⁻¹ p meets it at λ = (depth − n·c) / (n·R K_t⁻¹ p), and

    H = K_s (R (depth − n·c) + c nᵀR) K_t⁻¹            (Hartley and Zisserman, §13.1)

maps target pixels to source pixels. The border of the image is replicated outwards.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays, pixel_centers

MIN_DENOMINATOR = 1e-9
"""Rays that miss the plane get its border, in the direction of the ray."""


def plane_homography(source: Camera, target: Camera, depth: float) -> Float[Tensor, "3 3"]:
    """The homography from target pixels to source pixels, in float64."""
    source, target = source.to(torch.float64), target.to(torch.float64)
    pose = source_from_target(source, target)
    rotation, position = pose[:3, :3], pose[:3, 3:]
    return (
        _matrix(source)
        @ (rotation * (depth - position[2]) + position @ rotation[2:])
        @ torch.linalg.inv(_matrix(target))
    )


def source_from_target(source: Camera, target: Camera) -> Float[Tensor, "4 4"]:
    """Pose of the target camera in the source camera frame."""
    return rigid.invert(source.world_from_camera) @ target.world_from_camera


def warp_plane(
    rgb: Float[Tensor, "h w 3"], source: Camera, target: Camera, depth: float
) -> Float[Tensor, "h2 w2 3"]:
    """The image on its plane as seen by ``target``; bilinear."""
    pixels = pixel_centers(target.size_px, rgb.new_zeros((), dtype=torch.float64))
    ones = torch.ones_like(pixels[..., :1])
    homogeneous = torch.cat([pixels, ones], -1) @ plane_homography(source, target, depth).mT
    source_px = homogeneous[..., :2] / homogeneous[..., 2:].clamp_min(MIN_DENOMINATOR)
    height, width = source.size_px
    normalized = 2 * source_px / source_px.new_tensor([width, height]) - 1
    # The border is replicated, so half an image outside equals infinity, and stays finite.
    grid = normalized.clamp(-2, 2).to(rgb)[None]
    planar = rgb.movedim(-1, 0)[None]
    warped = torch.nn.functional.grid_sample(
        planar, grid, mode="bilinear", padding_mode="border", align_corners=False
    )
    return warped[0].movedim(0, -1)


def plane_depth(source: Camera, target: Camera, depth: float) -> Float[Tensor, "h2 w2"]:
    """Z of the plane in the target camera; 0 where its rays miss the plane."""
    source, target = source.to(torch.float64), target.to(torch.float64)
    pose = source_from_target(source, target)
    ray_z = (camera_rays(target) @ pose[:3, :3].mT)[..., 2]
    distance = (depth - pose[2, 3]) / torch.where(ray_z == 0, 1.0, ray_z)
    return torch.where((ray_z != 0) & (distance > 0), distance, 0.0).float()


def _matrix(camera: Camera) -> Float[Tensor, "3 3"]:
    matrix = torch.eye(3, dtype=torch.float64)
    matrix[0, 0], matrix[1, 1] = camera.focal_px.tolist()
    matrix[:2, 2] = camera.center_px
    return matrix

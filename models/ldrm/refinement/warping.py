"""Warping of images and features from one camera to another through depth.

Axes: ``b`` batch, ``c`` channels, ``d`` depths per pixel, ``h w`` pixels. A point at inverse depth
i of the source camera is, up to a positive factor, R ray + i t in the other camera
(R = other_from_source), which also holds for i = 0: infinitely far away.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays

NEAREST = 1e-3
"""Points nearer to the other camera's plane than this share of their depth are invisible."""


def other_pixels(
    source: Camera, other: Camera, inverse_depth: Float[Tensor, "b d h w"]
) -> tuple[Float[Tensor, "b d h w 2"], Float[Tensor, "b d h w"]]:
    """Projection of the points of ``source`` to ``other``: normalised (x, y), and relative depth.

    Coordinates are −1 to 1 over the image; relative depth is depth in ``other`` over depth in
    ``source``, below NEAREST for points behind the camera.
    """
    # Products of rotations must not follow the networks into half precision.
    with torch.autocast(source.focal_px.device.type, enabled=False):
        relative = rigid.invert(other.world_from_camera) @ source.world_from_camera
        rays = camera_rays(source) @ relative[:, None, :3, :3].mT
    points = rays[:, None] + inverse_depth[..., None] * relative[:, None, None, None, :3, 3]
    scale = points[..., 2].clamp_min(NEAREST)
    size = other.focal_px.new_tensor([other.size_px[1], other.size_px[0]])
    focal, center = (2 * part / size for part in (other.focal_px, other.center_px))
    axes = (..., None, None, None, slice(None))
    return points[..., :2] / scale[..., None] * focal[axes] + center[axes] - 1, points[..., 2]


def inside(
    pixels: Float[Tensor, "b d h w 2"], relative_depth: Float[Tensor, "b d h w"]
) -> Bool[Tensor, "b d h w"]:
    """Whether the points are within the other image and in front of its camera."""
    return (pixels.abs() < 1).all(-1) & (relative_depth > NEAREST)


def sampled(
    features: Float[Tensor, "b c h2 w2"], pixels: Float[Tensor, "b d h w 2"]
) -> Float[Tensor, "b c d h w"]:
    """Bilinear samples in the dtype of ``features``; the border is replicated."""
    depths, wide = pixels.shape[1], torch.promote_types(features.dtype, pixels.dtype)
    samples = torch.nn.functional.grid_sample(
        features.to(wide),
        pixels.flatten(1, 2).to(wide),
        padding_mode="border",
        align_corners=False,
    )
    return samples.unflatten(2, (depths, -1)).to(features.dtype)

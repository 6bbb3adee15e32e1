"""The scene before any correction: the image on a plane in front of the first camera.

Axes: ``t h w`` frames, rows and columns of the Gaussian grid. Every frame of the path gets one
Gaussian per cell of its camera, on the plane z = PLANE_DEPTH of the first camera. Those of the
first frame have the pixels' colours and are opaque. Those of later frames have the colour of the
plane where their ray meets it, and an opacity below the pruning threshold until a trained head
raises it.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.rays import world_rays
from diff4splat.models.ldrm.gaussian_head import PixelBase

PLANE_DEPTH = 4.0
"""Scene units. Keeps standard deviations near 0.006, which half precision resolves."""
OPAQUE, UNSEEN = 0.999, 0.002
"""Opacities of the first frame and of later ones; the paper prunes below 0.005."""
DISTANCE_RANGE = (PLANE_DEPTH / 8, PLANE_DEPTH * 8)


def plane_base(
    rgb: Float[Tensor, "h w 3"], camera: Camera, cameras: Camera, grid_stride: int
) -> PixelBase:
    """One cell per ``grid_stride``² pixels of every camera in the batch ``cameras``.

    ``rgb`` is the image that ``camera`` took.
    """
    height, width = camera.size_px
    grid = cameras.resized((height // grid_stride, width // grid_stride))
    rgb = _shrink(rgb, grid_stride)
    origins, directions = world_rays(grid)
    distance = _distance_to_plane(origins[..., 2], directions[..., 2])
    points = (origins + distance[..., None] * directions).flatten(1, 2)
    colors = _sample(rgb, camera.resized(grid.size_px), points)
    opacity = torch.full_like(distance, UNSEEN)
    opacity[0] = OPAQUE
    return PixelBase(
        rgb=torch.cat([rgb[None], colors.unflatten(1, grid.size_px)[1:]]),
        distance=distance,
        opacity=opacity,
        cameras=grid,
    )


def _shrink(rgb: Float[Tensor, "h w 3"], factor: int) -> Float[Tensor, "h2 w2 3"]:
    channels_first = rgb.movedim(-1, 0)[None]
    return torch.nn.functional.avg_pool2d(channels_first, factor)[0].movedim(0, -1)


def _distance_to_plane(
    origin_z: Float[Tensor, "t h w"], direction_z: Float[Tensor, "t h w"]
) -> Float[Tensor, "t h w"]:
    """Along each ray; rays that miss the plane get its depth."""
    hits = direction_z * (PLANE_DEPTH - origin_z) > 1e-6
    distance = (PLANE_DEPTH - origin_z) / torch.where(hits, direction_z, 1.0)
    return torch.where(hits, distance, PLANE_DEPTH).clamp(*DISTANCE_RANGE)


def _sample(
    rgb: Float[Tensor, "h w 3"], camera: Camera, points: Float[Tensor, "t n 3"]
) -> Float[Tensor, "t n 3"]:
    """Colours of the image where ``points`` project; its border is replicated."""
    pixels = project(camera, points.flatten(0, 1))[0].unflatten(0, points.shape[:2])
    height, width = camera.size_px
    normalized = 2 * pixels / pixels.new_tensor([width, height]) - 1
    colors = torch.nn.functional.grid_sample(
        rgb.movedim(-1, 0)[None],
        normalized[None],
        mode="bilinear",
        padding_mode="border",
        align_corners=False,
    )
    return colors[0].movedim(0, -1)

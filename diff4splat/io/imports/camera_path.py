"""A camera path for files that have none."""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, focal_from_fov, pinhole
from diff4splat.paths.camera_path import CameraPath

FPS, SIZE_PX, FOV_DEG = 24, (360, 640), 60.0
"""Frame rate, image size and horizontal field of view of the default camera path."""
_RADIUS_QUANTILE, _DISTANCE_IN_RADII = 0.9, 3.0


def default_path(means: Float[Tensor, "n 3"], time_range_s: tuple[float, float]) -> CameraPath:
    """A static camera outside the scene that looks along the z axis at the centre.

    The path covers ``time_range_s`` at ``FPS`` frames per second.
    """
    pose = torch.eye(4)
    pose[:3, 3] = _camera_position(means.float())
    camera = pinhole(focal_from_fov(FOV_DEG, SIZE_PX[1]), SIZE_PX).with_pose(pose)
    return static_path(camera, time_range_s)


def static_path(camera: Camera, time_range_s: tuple[float, float]) -> CameraPath:
    """One camera for all times."""
    start_s, stop_s = time_range_s
    frames = max(2, round((stop_s - start_s) * FPS) + 1)
    poses = camera.world_from_camera.reshape(4, 4).repeat(frames, 1, 1)
    times_s = torch.linspace(start_s, stop_s, frames)
    return CameraPath(cameras=camera.with_pose(poses), times_s=times_s)


def _camera_position(means: Float[Tensor, "n 3"]) -> Float[Tensor, " 3"]:
    """Three radii before the median of ``means``; a radius holds nine tenths of them."""
    if len(means) == 0:
        return torch.zeros(3)
    center = means.median(0).values
    distances = (means - center).norm(dim=-1).sort().values
    radius = float(distances[int(_RADIUS_QUANTILE * (len(distances) - 1))]) or 1.0
    return center - torch.tensor([0.0, 0.0, _DISTANCE_IN_RADII * radius])

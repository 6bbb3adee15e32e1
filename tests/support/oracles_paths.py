"""Independent answers for camera paths, in numpy float64 from the formulas."""

import math

import numpy as np
import torch

from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath


def natural_spline(keys_s: np.ndarray, values: np.ndarray, time_s: float) -> np.ndarray:
    """Natural cubic spline by a dense solve for the second derivatives."""
    count = len(keys_s)
    gap = np.diff(keys_s)
    matrix, right = np.eye(count), np.zeros_like(values)
    for i in range(1, count - 1):
        matrix[i, i - 1 : i + 2] = gap[i - 1], 2 * (gap[i - 1] + gap[i]), gap[i]
        right[i] = 6 * (
            (values[i + 1] - values[i]) / gap[i] - (values[i] - values[i - 1]) / gap[i - 1]
        )
    second = np.linalg.solve(matrix, right)
    i = min(max(int(np.searchsorted(keys_s, time_s, side="right")) - 1, 0), count - 2)
    a, b, h = keys_s[i + 1] - time_s, time_s - keys_s[i], gap[i]
    bend = (a**3 / h - a * h) * second[i] + (b**3 / h - b * h) * second[i + 1]
    return (a * values[i] + b * values[i + 1]) / h + bend / 6


def angle_deg(first: torch.Tensor, second: torch.Tensor) -> float:
    """Angle between two rotations from the chord: |R1 - R2|_F = 2 sqrt(2) sin(angle / 2)."""
    chord = float((first.double() - second.double()).norm()) / (2 * math.sqrt(2))
    return math.degrees(2 * math.asin(min(chord, 1.0)))


def random_rotations(generator: torch.Generator, count: int) -> torch.Tensor:
    """Rotations from a QR decomposition, determinant +1."""
    noise = torch.randn(count, 3, 3, generator=generator, dtype=torch.float64)
    orthogonal, _ = torch.linalg.qr(noise)
    return orthogonal * torch.linalg.det(orthogonal)[:, None, None]


def random_path(seed: int, count: int, *, centered: bool = False) -> CameraPath:
    """A float64 path whose first camera is the identity at time 0."""
    generator = torch.Generator().manual_seed(seed)
    poses = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    poses[1:, :3, :3] = random_rotations(generator, count - 1)
    poses[1:, :3, 3] = 10 * torch.randn(count - 1, 3, generator=generator, dtype=torch.float64)
    focal = 30 + 50 * torch.rand(count, 2, generator=generator, dtype=torch.float64)
    center = torch.tensor([32.0, 24.0], dtype=torch.float64).repeat(count, 1)
    if centered:
        focal = focal[:, :1].expand(count, 2)
    else:
        center = center + torch.randn(count, 2, generator=generator, dtype=torch.float64)
    gaps = 0.01 + torch.rand(count, generator=generator, dtype=torch.float64)
    cameras = Camera(focal_px=focal, center_px=center, world_from_camera=poses, size_px=(48, 64))
    return CameraPath(cameras=cameras, times_s=gaps.cumsum(0) - gaps[0])


def rounded(path: CameraPath, digits: int) -> CameraPath:
    """The path as text with so many digits after the point would bring it."""
    cameras = path.cameras.with_pose(path.cameras.world_from_camera.round(decimals=digits))
    return CameraPath(cameras=cameras, times_s=path.times_s)


def pose_error(found: CameraPath, expected: CameraPath) -> float:
    """Largest difference of any matrix entry."""
    poses = found.cameras.world_from_camera, expected.cameras.world_from_camera
    return float((poses[0].double() - poses[1].double()).abs().max())

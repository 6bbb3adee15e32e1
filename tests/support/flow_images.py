"""Images of which optical flow is known, and cameras that turn in place."""

import math

import torch
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole

INSIDE = (..., slice(12, -12), slice(12, -12))
"""Away from the border."""


def texture(count: int = 1, side: int = 64) -> Tensor:
    """Smooth enough to have slopes."""
    coarse = torch.rand(count, 3, side // 8, side // 8, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.interpolate(coarse, scale_factor=8, mode="bicubic").clamp(0, 1)


def cameras(count: int, turn: float = 0.0, batch: int = 1) -> Camera:
    """All at one place; each is turned around z once more than the one before it."""
    poses = torch.eye(4).repeat(batch, count, 1, 1)
    for index in range(count):
        sine, cosine = math.sin(turn * index), math.cos(turn * index)
        poses[:, index, :2, :2] = torch.tensor([[cosine, -sine], [sine, cosine]])
    one = pinhole(64.0, (64, 64))
    return Camera(
        focal_px=one.focal_px.expand(batch, count, 2),
        center_px=one.center_px.expand(batch, count, 2),
        world_from_camera=poses,
        size_px=(64, 64),
    )

"""A wall of coloured dots behind a dot that flies past: every effect of a camera shows in it."""

from pathlib import Path

import numpy as np
import torch
from PIL import Image

from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene

WALL_DEPTH, DOT_DEPTH = 4.0, 2.0


def filmed_scene(
    frames: int = 2, size_px: tuple[int, int] = (10, 12), side: int = 5, focal: float = 0.8
) -> Scene:
    """``side`` squared dots on the wall; the camera goes right while the near dot goes down."""
    across = torch.linspace(-3, 3, side)
    x, y = torch.meshgrid(across, across, indexing="xy")
    wall = torch.stack([x, y, torch.full_like(x, WALL_DEPTH)], -1).reshape(-1, 3)
    means = torch.cat([wall, torch.tensor([[0.0, -0.2, DOT_DEPTH]])])
    count = len(means)
    colors = torch.stack(
        [0.5 + means[:, 0] / 6, 0.5 + means[:, 1] / 6, torch.full((count,), 0.3)], -1
    )
    colors[-1] = torch.tensor([1.0, 0.9, 0.2])
    scales = torch.full((count, 3), 0.35 * 6 / side)
    scales[-1] = 0.2
    return Scene(
        gaussians=Gaussians(
            means=means,
            quats=torch.tensor([[1.0, 0, 0, 0]]).expand(count, 4).clone(),
            scales=scales,
            opacities=torch.full((count,), 0.95),
            sh=((colors - 0.5) / 0.28209479177387814)[:, None],
        ),
        motion=falling(count - 1),
        path=going_right(frames, size_px, focal),
        provenance=Provenance(generator="diff4splat test", license="CC0-1.0"),
    )


def falling(index: int) -> KeyframeMotion:
    """One Gaussian goes down by one unit in a second."""
    offsets = torch.tensor([[[0.0, -0.5, 0.0]], [[0.0, 0.5, 0.0]]])
    return KeyframeMotion(
        key_times_s=torch.tensor([-0.5, 0.5]),
        moving_index=torch.tensor([index]),
        offsets=offsets,
        rotations=torch.tensor([1.0, 0, 0, 0]).expand(2, 1, 4).clone(),
        log_scale_offsets=torch.zeros(2, 1, 3),
    )


def going_right(frames: int, size_px: tuple[int, int], focal: float) -> CameraPath:
    """Half a unit per second, ten frames per second."""
    times_s = torch.arange(frames) / 10
    poses = torch.eye(4).repeat(frames, 1, 1)
    poses[:, 0, 3] = 0.5 * times_s
    cameras = pinhole(focal * size_px[1], size_px).with_pose(poses)
    return CameraPath(cameras=cameras, times_s=times_s)


def png_rgb(file: Path) -> torch.Tensor:
    """An image of any size, RGB in [0, 1]."""
    with Image.open(file) as image:
        return torch.from_numpy(np.asarray(image.convert("RGB")).astype(np.float32) / 255)

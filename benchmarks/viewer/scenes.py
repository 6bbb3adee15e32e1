"""A scene of any size: a wall that stands, and a body in front of it that turns, waves and rises.

Axes: ``n`` Gaussians, ``m`` that move, ``t`` key times.
"""

import math

import torch
from torch import Tensor

from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene

SIZE_PX, KEYS, SPAN_S = (512, 512), 13, 2.0
BODY_DEPTH = 4.0


def moving_scene(count: int, keys: int = KEYS) -> Scene:
    """Half of ``count`` Gaussians move, each on its own curve."""
    generator = torch.Generator().manual_seed(0)
    camera = pinhole(float(SIZE_PX[1]), SIZE_PX)
    moving = count // 2
    body, wall = _body(moving, generator), _wall(count - moving, generator)
    return Scene(
        gaussians=_gaussians(torch.cat([body, wall]), float(camera.focal_px[0]), generator),
        motion=_motion(body, keys),
        path=_slide(camera.with_pose(torch.eye(4))),
        provenance=Provenance(generator="benchmark", prompt="a body that turns, waves and rises"),
    )


def _body(count: int, generator: torch.Generator) -> Tensor:
    """Points in a ball."""
    direction = torch.nn.functional.normalize(torch.randn(count, 3, generator=generator), dim=1)
    ball = direction * torch.rand(count, 1, generator=generator) ** (1 / 3)
    return ball + torch.tensor([0.0, 0.0, BODY_DEPTH])


def _wall(count: int, generator: torch.Generator) -> Tensor:
    """Points on a rough plane."""
    place = torch.rand(count, 3, generator=generator)
    return (place - 0.5) * torch.tensor([8.0, 8.0, 0.5]) + torch.tensor([0.0, 0.0, 7.0])


def _gaussians(means: Tensor, focal_px: float, generator: torch.Generator) -> Gaussians:
    """Standard deviations of 1 to 2 px, opacities of 0.3 to 1, colours by place and chance."""
    count = len(means)
    sigma_px = 1 + torch.rand(count, 3, generator=generator)
    color = 0.5 + 0.4 * torch.sin(3 * means) + 0.1 * torch.randn(count, 3, generator=generator)
    return Gaussians(
        means=means,
        quats=torch.randn(count, 4, generator=generator),
        scales=sigma_px * means[:, 2:] / focal_px,
        opacities=0.3 + 0.7 * torch.rand(count, generator=generator),
        sh=((color.clamp(0, 1) - 0.5) / 0.28209479177387814)[:, None],
    )


def _motion(means: Tensor, keys: int) -> KeyframeMotion:
    """A turn about the vertical that is larger higher up, a wave, and a rise."""
    times_s = torch.linspace(0, SPAN_S, keys)
    local = means - torch.tensor([0.0, 0.0, BODY_DEPTH])
    angle = times_s[:, None] * (0.6 + 0.4 * local[:, 1])
    x = angle.cos() * local[:, 0] + angle.sin() * local[:, 2]
    z = angle.cos() * local[:, 2] - angle.sin() * local[:, 0]
    wave = 0.2 * torch.sin(math.tau * times_s[:, None] / SPAN_S + 2 * local[:, 0])
    y = local[:, 1] + wave - 0.2 * times_s[:, None]
    half, zero = angle / 2, torch.zeros_like(angle)
    return KeyframeMotion(
        key_times_s=times_s,
        moving_index=torch.arange(len(means)),
        offsets=torch.stack([x, y, z], -1) - local,
        rotations=torch.stack([half.cos(), zero, half.sin(), zero], -1),
        log_scale_offsets=torch.zeros(keys, len(means), 3),
    )


def _slide(camera: object) -> CameraPath:
    poses = torch.eye(4).repeat(9, 1, 1)
    poses[:, 0, 3] = torch.linspace(-0.3, 0.3, 9)
    return CameraPath(cameras=camera.with_pose(poses), times_s=torch.linspace(0, SPAN_S, 9))

"""Captures of a few pixels: a ball that moves among others, and the same spoilt."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame, PointCloud
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera, focal_from_fov, pinhole, stack_cameras
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

SIDE_PX, VIEWS, TIMES = 20, 3, 3
BALLS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryFrames:
    """Frames in memory."""

    images: tuple[Float[Tensor, "h w 3"], ...]

    def __len__(self) -> int:
        return len(self.images)

    def read(self, index: int) -> Frame:
        """The frame of that index."""
        return Frame(rgb=self.images[index])


def tiny_captures() -> Mapping[str, Callable[[], Capture]]:
    """Name → capture."""
    return {
        "moving balls": moving_balls,
        "constant images": lambda: _with_images(lambda rgb: torch.full_like(rgb, 0.5)),
        "black images": lambda: _with_images(torch.zeros_like),
        "noise": lambda: _with_images(torch.rand_like),
        "one time": lambda: moving_balls(times=1),
        "all cameras at one place": lambda: moving_balls(spread_deg=0.0),
    }


def moving_balls(times: int = TIMES, spread_deg: float = 60.0) -> Capture:
    """Every camera of an arc at every time; the last camera is for evaluation."""
    cameras = [_camera(view, spread_deg) for view in range(VIEWS)]
    times_s = [step / max(times - 1, 1) for step in range(times)]
    shown = [(view, time_s) for view in range(VIEWS) for time_s in times_s]
    images = [render(_balls(time_s), cameras[view]).rgb.clamp(0, 1) for view, time_s in shown]
    generator = torch.Generator().manual_seed(1)
    return Capture(
        name="balls",
        source="stability report",
        cameras=stack_cameras([cameras[view] for view, _ in shown]).to(torch.float64),
        times_s=torch.tensor([time_s for _, time_s in shown], dtype=torch.float64),
        camera_index=torch.tensor([view for view, _ in shown]),
        held_out=torch.tensor([view == VIEWS - 1 for view, _ in shown]),
        frames=MemoryFrames(images=tuple(images)),
        points=PointCloud(
            positions=1.2 * (torch.rand(40, 3, generator=generator) - 0.5),
            rgb=torch.full((40, 3), 0.5),
        ),
        background=(0.0, 0.0, 0.0),
    )


def _with_images(change: Callable[[Tensor], Tensor]) -> Capture:
    capture = moving_balls()
    images = tuple(map(change, capture.frames.images))
    return replace(capture, frames=MemoryFrames(images=images))


def _camera(view: int, spread_deg: float) -> Camera:
    angle = math.radians(spread_deg * (view / (VIEWS - 1) - 0.5))
    eye = torch.tensor([2.4 * math.sin(angle), -0.4, -2.4 * math.cos(angle)])
    pose = rigid.look_at(eye, torch.zeros(3), torch.tensor([0.0, 1.0, 0.0]))
    return pinhole(focal_from_fov(50.0, SIDE_PX), (SIDE_PX, SIDE_PX)).with_pose(pose)


def _balls(time_s: float) -> Gaussians:
    """The first one crosses from left to right."""
    generator = torch.Generator().manual_seed(4)
    means = torch.rand(BALLS, 3, generator=generator) - 0.5
    means[0] = torch.tensor([time_s - 0.5, 0.0, -0.3])
    return Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).expand(BALLS, 4),
        scales=torch.full((BALLS, 3), 0.16),
        opacities=torch.full((BALLS,), 0.95),
        sh=dc_from_color(torch.rand(BALLS, 3, generator=generator))[:, None],
    )

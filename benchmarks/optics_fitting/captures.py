"""Captures of a world: every camera at every time, through optics that may be told wrongly.

Images are photographs with many samples, rounded to eight bits. Points to start from are the
places of the things, up to 8 cm off, with colours half of the way to grey.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from benchmarks.optics_fitting.worlds import World
from diff4splat.data.capture.capture import Capture, Frame, PointCloud
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.metrics.image import psnr
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.scene import Scene

TRUE = PhotoSettings(samples=256)
OFF = 0.08


@dataclass(kw_only=True)
class Pictures:
    """Frames in memory."""

    shown: list[Frame]

    def __len__(self) -> int:
        return len(self.shown)

    def read(self, index: int) -> Frame:
        return self.shown[index]


def taken(
    world: World, cameras: Sequence[Camera], times_s: Sequence[float], optics: Optics, held: int
) -> Capture:
    """The capture, with its true optics; every ``held``-th camera is held out."""
    shown, own, at_s, index = [], [], [], []
    for number, camera in enumerate(cameras):
        for time_s in times_s:
            seer = PhysicalCamera(camera=camera, optics=optics)
            with torch.no_grad():
                made = photograph(world.scene, seer, time_s, settings=TRUE)
            shown.append(Frame(rgb=(made.rgb.clamp(0, 1) * 255).round() / 255))
            own.append(camera)
            at_s.append(time_s)
            index.append(number)
    camera_index = torch.tensor(index)
    return Capture(
        name="room", source="benchmark", cameras=stack_cameras(own),
        times_s=torch.tensor(at_s).double(), camera_index=camera_index,
        held_out=camera_index % held == held // 2, frames=Pictures(shown=shown), optics=optics,
        points=points(world), background=(0.0, 0.0, 0.0),
    )  # fmt: skip


def points(world: World) -> PointCloud:
    """Where a fit starts."""
    generator = torch.Generator().manual_seed(9)
    means = world.scene.state_at(sum(world.scene.motion.time_range_s) / 2).means
    noise = OFF * (2 * torch.rand(means.shape, generator=generator) - 1)
    colors = color_from_dc(world.scene.gaussians.sh[:, 0])
    return PointCloud(positions=means + noise, rgb=0.5 * colors + 0.25)


def told(capture: Capture, optics: Optics | None) -> Capture:
    """The same images with something else said of the cameras."""
    return replace(capture, optics=optics)


@torch.no_grad()
def seen_db(
    truth: Scene, scene: Scene, cameras: Sequence[Camera], times_s: Sequence[float]
) -> float:
    """PSNR of pinhole images of a fit against those of the truth, the mean over images."""
    found: list[Tensor] = []
    for camera in cameras:
        for time_s in times_s:
            seer = PhysicalCamera(camera=camera)
            pair = [photograph(one, seer, time_s).rgb.clamp(0, 1) for one in (scene, truth)]
            found.append(psnr(*pair))
    return float(torch.stack(found).mean())

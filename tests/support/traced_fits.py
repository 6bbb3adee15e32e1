"""Captures for fits by rays: 12 px, a ball on its way among others, through optics.

The ball and its speed are given to the fit, so that what is left to find is the camera.
"""

from dataclasses import replace

import torch
from small_fits import Images, ring

from diff4splat.data.capture.capture import Capture, Frame, PointCloud
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.physical.api import photograph
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

SIDE_PX = 12
COUNT = 20
SPEED = 1.5


def gaussians() -> Gaussians:
    """Twenty coloured balls."""
    generator = torch.Generator().manual_seed(7)
    return Gaussians(
        means=1.2 * (torch.rand(COUNT, 3, generator=generator) - 0.5),
        quats=torch.tensor([[1.0, 0, 0, 0]]).repeat(COUNT, 1),
        scales=torch.full((COUNT, 3), 0.14),
        opacities=torch.full((COUNT,), 0.9),
        sh=dc_from_color(torch.rand(COUNT, 3, generator=generator))[:, None],
    )


def flight() -> SpacetimeMotion:
    """All go down."""
    return SpacetimeMotion(
        moving_index=torch.arange(COUNT),
        velocities=torch.tensor([[0.0, SPEED, 0.0]]).repeat(COUNT, 1),
        time_centers_s=torch.full((COUNT,), 0.5),
        time_deviations_s=torch.full((COUNT,), 10.0),
        time_range_s=(0.0, 1.0),
        period_s=1.0,
    )


def scene(motion: Motion | None = None) -> Scene:
    """The balls, standing unless told otherwise."""
    camera = ring(1, SIDE_PX)[0]
    return Scene(
        gaussians=gaussians(),
        motion=motion or StaticMotion(time_range_s=(0.0, 1.0)),
        path=CameraPath(cameras=stack_cameras([camera]), times_s=torch.zeros(1).double()),
        provenance=Provenance(generator="test"),
    )


def photographed(
    truth: Scene, optics: Optics, views: int = 3, times_s: tuple[float, ...] = (0.4, 0.6)
) -> Capture:
    """Every camera at every time; the last camera is held out."""
    cameras: list[Camera] = []
    shown, at_s, index = [], [], []
    for number, camera in enumerate(ring(views, SIDE_PX)):
        for time_s in times_s:
            with torch.no_grad():
                made = photograph(truth, PhysicalCamera(camera=camera, optics=optics), time_s)
            shown.append(Frame(rgb=made.rgb.clamp(0, 1)))
            cameras.append(camera)
            at_s.append(time_s)
            index.append(number)
    generator = torch.Generator().manual_seed(1)
    near = gaussians().means + 0.05 * torch.randn(COUNT, 3, generator=generator)
    return Capture(
        name="balls",
        source="test",
        cameras=stack_cameras(cameras),
        times_s=torch.tensor(at_s).double(),
        camera_index=torch.tensor(index),
        held_out=torch.tensor(index) == views - 1,
        frames=Images(shown=shown),
        optics=optics,
        points=PointCloud(positions=near, rgb=torch.full((COUNT, 3), 0.5)),
        background=(0.0, 0.0, 0.0),
    )


def said(capture: Capture, optics: Optics | None) -> Capture:
    """The same images, with something else said of the cameras."""
    return replace(capture, optics=optics)

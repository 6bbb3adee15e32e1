"""Frames of native 4D Gaussians that share work are the frames made one by one."""

from dataclasses import replace

import pytest
import torch
from oracles_render import random_gaussians

from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render, render_video
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Provenance, Scene

COUNT, FRAMES = 120, 6
OUTPUTS = ("rgb", "alpha", "depth", "median_depth")


def spacetime_scene(bands: int, turning: bool, step: int = 2) -> Scene:
    """Pulses that begin and end while the clip runs, and some that never end."""
    moving = torch.arange(0, COUNT, step)
    count = len(moving)
    deviations = 0.02 + 0.3 * torch.rand(count)
    deviations[::5] = torch.inf
    motion = SpacetimeMotion(
        moving_index=moving,
        velocities=0.4 * torch.randn(count, 3),
        time_centers_s=torch.rand(count),
        time_deviations_s=deviations,
        time_range_s=(0.0, 1.0),
        color_waves=0.5 * torch.randn(count, 2, bands, 3),
    )
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    if turning:
        poses[:, 0, 3] = torch.linspace(-0.3, 0.3, FRAMES)
    cameras = pinhole(40.0, (70, 90)).with_pose(poses)
    gaussians = random_gaussians(COUNT, bands=bands, dtype=torch.float32)
    return Scene(
        gaussians=replace(gaussians, scales=0.4 * gaussians.scales),
        motion=motion,
        path=CameraPath(cameras=cameras, times_s=torch.linspace(0.0, 1.1, FRAMES)),
        provenance=Provenance(generator="test"),
    )


@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("bands", [1, 4])
@pytest.mark.parametrize("step", [1, 2])
def test_sequences_are_frame_by_frame_images(turning: bool, bands: int, step: int) -> None:
    scene = spacetime_scene(bands, turning, step)
    frames = list(render_video(scene, scene.path, outputs=OUTPUTS))
    for index, made in enumerate(frames):
        camera, time_s = scene.path.cameras[index], float(scene.path.times_s[index])
        for backend in ("raster", "reference"):
            alone = render(scene, camera, time_s, outputs=OUTPUTS, backend=backend)
            for name in OUTPUTS:
                off = (getattr(made, name) - getattr(alone, name)).abs() > 1e-3
                assert off.float().mean() < 2e-3, (backend, name, index)
    assert float((frames[0].rgb - frames[3].rgb).abs().mean()) > 1e-3


def test_gradients_reach_every_part_of_the_motion() -> None:
    scene = spacetime_scene(4, turning=False)
    names = ("velocities", "time_centers_s", "time_deviations_s", "color_waves")
    leaves = {name: getattr(scene.motion, name).clone().requires_grad_() for name in names}
    scene = replace(scene, motion=replace(scene.motion, **leaves))
    sum(frame.rgb.square().sum() for frame in render_video(scene, scene.path)).backward()
    for name, leaf in leaves.items():
        assert bool(leaf.grad.any()), name
        assert bool(torch.isfinite(leaf.grad).all()), name

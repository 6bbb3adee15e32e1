"""Flow against the projection of points at two times."""

from dataclasses import replace

import pytest
import torch
from oracles_render import random_gaussians, small_camera

from diff4splat.geometry.camera import project
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene

CAMERA = small_camera((9, 11))
VELOCITY = torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64)


def moving(gaussians: Gaussians) -> Scene:
    """``gaussians`` on straight lines at VELOCITY, for 1 s."""
    count = len(gaussians)
    still = torch.zeros(2, count, 3, dtype=torch.float64)
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 1.0], dtype=torch.float64),
        moving_index=torch.arange(count),
        offsets=torch.stack([still[0], still[0] + VELOCITY]),
        rotations=torch.eye(4, dtype=torch.float64)[0].expand(2, count, 4),
        log_scale_offsets=still,
    )
    batch = CAMERA.with_pose(CAMERA.world_from_camera[None])
    path = CameraPath(cameras=batch, times_s=torch.zeros(1))
    return Scene(
        gaussians=gaussians, motion=motion, path=path, provenance=Provenance(generator="test")
    )


def one() -> Gaussians:
    """One Gaussian near the middle of the image."""
    gaussian = random_gaussians(1)
    return replace(gaussian, means=torch.tensor([[0.2, 0.1, 2.0]], dtype=torch.float64))


def flow_and_alpha(scene: Scene | Gaussians, settings: RenderSettings):
    made = render(scene, CAMERA, 0.25, outputs=("flow", "alpha"), settings=settings)
    return made.flow, made.alpha


def test_a_moving_gaussian_carries_its_pixels_along() -> None:
    flow, alpha = flow_and_alpha(moving(one()), RenderSettings(flow_time_s=0.75))
    start, _ = project(CAMERA, one().means + 0.25 * VELOCITY)
    stop, _ = project(CAMERA, one().means + 0.75 * VELOCITY)
    torch.testing.assert_close(flow[alpha > 0], (stop - start).expand(int((alpha > 0).sum()), 2))
    assert not flow[alpha == 0].any()


def test_flow_over_a_short_time_is_the_velocity_on_the_image() -> None:
    step_s = 1e-6
    flow, alpha = flow_and_alpha(moving(one()), RenderSettings(flow_time_s=0.25 + step_s))
    means = (one().means + 0.25 * VELOCITY).requires_grad_()
    jacobian = torch.autograd.functional.jacobian(lambda m: project(CAMERA, m)[0], means)[0, :, 0]
    velocity_px = jacobian @ VELOCITY
    torch.testing.assert_close(flow[alpha > 0][0] / step_s, velocity_px, rtol=1e-4, atol=1e-4)


def test_a_moving_camera_makes_flow_too() -> None:
    pose = CAMERA.world_from_camera.clone()
    pose[:3, 3] += VELOCITY
    later = CAMERA.with_pose(pose)
    flow, alpha = flow_and_alpha(one(), RenderSettings(flow_camera=later))
    shift = project(later, one().means)[0] - project(CAMERA, one().means)[0]
    torch.testing.assert_close(flow[alpha > 0][0], shift[0])


def test_flow_is_the_mean_over_what_is_seen() -> None:
    pair = random_gaussians(2, bands=1)
    pair = replace(
        pair, means=torch.tensor([[0.2, 0.1, 2.0], [0.25, 0.1, 3.0]], dtype=torch.float64)
    )
    settings = RenderSettings(flow_time_s=1.0)
    flow, alpha = flow_and_alpha(moving(pair), settings)
    start, _ = project(CAMERA, pair.means + 0.25 * VELOCITY)
    stop, _ = project(CAMERA, pair.means + VELOCITY)
    near = render(moving(pair.select(torch.tensor([0]))), CAMERA, 0.25, outputs=("alpha",)).alpha
    weights = torch.stack([near, alpha - near], -1)
    want = (weights @ (stop - start)) / weights.sum(-1, keepdim=True)
    torch.testing.assert_close(flow[alpha > 0], want[alpha > 0])


@pytest.mark.parametrize("target", [[0.2, 0.1, -10.0], [float("nan")] * 3])
def test_what_the_other_view_cannot_see_has_no_say(target: list[float]) -> None:
    # The nearer Gaussian ends behind the second camera, or nowhere at all.
    pair = random_gaussians(2, bands=1)
    places = torch.tensor([[0.2, 0.1, 2.0], [0.2, 0.1, 20.0]], dtype=torch.float64)
    still = torch.zeros(3, 2, 3, dtype=torch.float64)
    offsets = still.clone()
    offsets[2, 0] = torch.tensor(target, dtype=torch.float64) - places[0]
    # With a key in between, the state at the first key does not touch a NaN at the last.
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.5, 1.0], dtype=torch.float64),
        moving_index=torch.arange(2),
        offsets=offsets,
        rotations=torch.eye(4, dtype=torch.float64)[0].expand(3, 2, 4),
        log_scale_offsets=still,
    )
    scene = replace(moving(replace(pair, means=places)), motion=motion)
    pose = CAMERA.world_from_camera.clone().requires_grad_()
    settings = RenderSettings(flow_time_s=1.0, flow_camera=CAMERA.with_pose(pose))
    made = render(scene, CAMERA, 0.0, outputs=("flow", "alpha"), settings=settings)
    assert made.dropped_nonfinite == 0
    assert bool((made.alpha > 0.1).any())
    assert not made.flow.any()
    made.flow.sum().backward()
    assert bool(torch.isfinite(pose.grad).all())

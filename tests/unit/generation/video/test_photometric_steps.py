"""Gradient steps of a reconstructed scene on the frames of its video."""

from dataclasses import replace

import pytest
import torch
from image_layers import sliding_path

from diff4splat.generation.video.photometric_steps import (
    Frames,
    better,
    falling_adam,
    take_photometric_steps,
    video_error,
)
from diff4splat.generation.video.scene_change import RATES, CellRays, changed, zero_change
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

SIDE_PX, FRAMES = 24, 5
CAMERA = pinhole(30.0, (SIDE_PX, SIDE_PX))


def path(slide: float = 0.6) -> CameraPath:
    return sliding_path(CAMERA, FRAMES, (slide, 0.0, 0.0))


def true_scene(count: int = 200) -> Scene:
    torch.manual_seed(3)
    gaussians = Gaussians(
        means=torch.rand(count, 3) * torch.tensor([4.0, 3.0, 2.0]) - torch.tensor([1.5, 1.5, -3.0]),
        quats=torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1),
        scales=torch.full((count, 3), 0.12),
        opacities=torch.full((count,), 0.9),
        sh=torch.randn(count, 1, 3),
    )
    motion = StaticMotion(time_range_s=(0.0, float(FRAMES - 1)))
    return Scene(
        gaussians=gaussians, motion=motion, path=path(), provenance=Provenance(generator="test")
    )


def video_of(scene: Scene) -> Frames:
    rgb = [render(scene, path().cameras[i], float(path().times_s[i])).rgb for i in range(FRAMES)]
    return Frames(rgb=torch.stack(rgb), path=path())


def wrong(scene: Scene) -> Scene:
    """Each Gaussian a little off in place, size, opacity and colour."""
    old = scene.gaussians
    gaussians = replace(
        old,
        means=old.means + 0.05 * torch.randn_like(old.means),
        scales=old.scales * 1.2,
        opacities=old.opacities * 0.8,
        sh=old.sh * 0.7,
    )
    return replace(scene, gaussians=gaussians)


def rays_of(scene: Scene) -> CellRays:
    cells = torch.arange(len(scene.gaussians) // 2)
    origins = torch.zeros(len(cells), 3)
    return CellRays(origins=origins, cell_index=cells, grid=(1, 10, 10))


def stepped(scene: Scene, frames: Frames, steps: int) -> Scene:
    return take_photometric_steps(scene, rays_of(scene), frames, steps, RunLog())


def test_frames_and_a_view_beside_the_path_come_nearer_to_the_truth() -> None:
    truth = true_scene()
    start, frames = wrong(truth), video_of(truth)
    with torch.no_grad():
        end = stepped(start, frames, 10)
    assert video_error(end, frames) < 0.5 * video_error(start, frames)
    beside = path(-0.6).cameras[2]
    distance = [
        float((render(one, beside).rgb - render(truth, beside).rgb).square().mean())
        for one in (start, end)
    ]
    assert distance[1] < 0.8 * distance[0]
    assert not end.gaussians.means.requires_grad


def test_steps_are_those_of_the_formula() -> None:
    """Adam as in arXiv 1412.6980, algorithm 1, on the gradient of the whole error at once."""
    truth = true_scene(40)
    start, frames, steps = wrong(truth), video_of(truth), 3
    about = rays_of(start)
    change = zero_change(start.gaussians, about)
    first = {name: torch.zeros_like(value) for name, value in change.items()}
    second = {name: torch.zeros_like(value) for name, value in change.items()}
    for step in range(steps):
        scene = replace(start, gaussians=changed(start.gaussians, change, about))
        renders = [
            render(scene, frames.path.cameras[i], float(frames.path.times_s[i])).rgb
            for i in range(FRAMES)
        ]
        error = (torch.stack(renders) - frames.rgb).square().mean()
        slopes = torch.autograd.grad(error, list(change.values()))
        for (name, value), slope in zip(change.items(), slopes, strict=True):
            first[name] = 0.8 * first[name] + 0.2 * slope
            second[name] = 0.95 * second[name] + 0.05 * slope**2
            mean = first[name] / (1 - 0.8 ** (step + 1))
            deviation = (second[name] / (1 - 0.95 ** (step + 1))).sqrt()
            rate = RATES[name] * (1 - 0.8 * step / steps)
            change[name] = (value - rate * mean / (deviation + 1e-15)).detach().requires_grad_()
    want = changed(start.gaussians, change, about)
    got = stepped(start, frames, steps).gaussians
    for name in ("means", "scales", "opacities", "sh"):
        torch.testing.assert_close(getattr(got, name), getattr(want, name), rtol=1e-3, atol=1e-4)


def test_more_steps_are_nearer_to_the_frames() -> None:
    truth = true_scene()
    start, frames = wrong(truth), video_of(truth)
    errors = [video_error(stepped(start, frames, steps), frames) for steps in (0, 3, 12)]
    assert errors[0] > errors[1] > errors[2]


def test_motion_stays_and_is_rendered() -> None:
    """Frames of a moving scene agree with it as it moves, not as it is at rest."""
    truth = true_scene()
    offsets = torch.zeros(2, 200, 3)
    offsets[1, :, 0] = 0.8
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, FRAMES - 1.0]),
        moving_index=torch.arange(200),
        offsets=offsets,
        rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(2, 200, 1),
        log_scale_offsets=torch.zeros(2, 200, 3),
    )
    moving = replace(truth, motion=motion)
    frames = video_of(moving)
    end = stepped(wrong(moving), frames, 10)
    assert end.motion is motion
    assert video_error(end, frames) < 0.5 * video_error(wrong(moving), frames)


def test_nothing_to_do_is_the_same_scene() -> None:
    truth = true_scene()
    frames = video_of(truth)
    assert stepped(truth, frames, 0) is truth
    empty = truth.select(torch.zeros(200, dtype=torch.bool))
    assert stepped(empty, frames, 3) is empty


def test_a_scene_that_shows_its_frames_is_kept() -> None:
    """Adam's first step is as long for a small gradient as for a large one."""
    truth = true_scene()
    assert stepped(truth, video_of(truth), 1) is truth


def test_rates_fall_linearly_to_a_fifth() -> None:
    change = zero_change(true_scene().gaussians, rays_of(true_scene()))
    optimizer, decay = falling_adam(change, 4)
    seen = []
    for _ in range(5):
        seen.append([group["lr"] for group in optimizer.param_groups])
        optimizer.step()
        decay.step()
    first = torch.tensor(list(RATES.values()))
    torch.testing.assert_close(torch.tensor(seen[0]), first)
    torch.testing.assert_close(torch.tensor(seen[2]), 0.6 * first)
    torch.testing.assert_close(torch.tensor(seen[4]), 0.2 * first)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_frames_that_are_not_finite_change_nothing(value: float) -> None:
    start = wrong(true_scene())
    frames = video_of(true_scene())
    frames.rgb[2, 3, 4] = value
    assert stepped(start, frames, 2) is start


def test_a_better_scene_with_a_value_that_is_not_finite_is_refused() -> None:
    truth = true_scene()
    start, frames = wrong(truth), video_of(truth)
    broken = replace(truth.gaussians, scales=truth.gaussians.scales.clone())
    broken.scales[0] = float("nan")
    assert better(start, replace(truth, gaussians=broken), frames) is start
    assert better(start, truth, frames) is truth

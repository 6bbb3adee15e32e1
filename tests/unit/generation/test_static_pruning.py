"""Dropping tracks: the promise is in pixels, so it is measured in pixels."""

from dataclasses import replace

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.generation.static_pruning import (
    largest_displacement_px,
    prune_static_tracks,
    static_threshold_px,
)
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

COUNT = 200
CAMERA = pinhole(200.0, (200, 200))


def moving_scene(strength: float) -> Scene:
    """Gaussians of many sizes and depths whose motions differ by five orders of magnitude."""
    share = torch.logspace(-5, 0, COUNT)[None, :, None] * strength
    small_turns = torch.cat([torch.ones(3, COUNT, 1), share * torch.randn(3, COUNT, 3)], -1)
    gaussians = Gaussians(
        means=torch.rand(COUNT, 3) * 2 + torch.tensor([-1.0, -1.0, 0.5]),
        quats=quaternion.normalize(torch.randn(COUNT, 4)),
        scales=torch.rand(COUNT, 3) * 0.1,
        opacities=torch.rand(COUNT),
        sh=torch.zeros(COUNT, 1, 3),
    )
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 1.0, 2.0]),
        moving_index=torch.arange(COUNT),
        offsets=share * torch.randn(3, COUNT, 3),
        rotations=quaternion.normalize(small_turns),
        log_scale_offsets=share * torch.randn(3, COUNT, 3),
    )
    path = CameraPath(cameras=CAMERA.with_pose(torch.eye(4)[None]), times_s=torch.zeros(1))
    return Scene(
        gaussians=gaussians, motion=motion, path=path, provenance=Provenance(generator="test")
    )


def rims(gaussians: Gaussians) -> torch.Tensor:
    """The six ends of the axes of every Gaussian, three standard deviations out: (6, n, 3)."""
    axes = quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None, :] * 3
    ends = axes.movedim(-1, 0)
    return torch.cat([gaussians.means + ends, gaussians.means - ends])


def moved_px(scene: Scene, camera: Camera) -> torch.Tensor:
    """How far the centre and the rim of each Gaussian really go on the picture, at any key."""
    farthest = torch.zeros(COUNT)
    before = rims(scene.gaussians)
    for time_s in (0.0, 1.0, 2.0):
        after = rims(scene.state_at(time_s))
        focal_per_depth = camera.focal_px.max() / scene.gaussians.means[:, 2]
        farthest = torch.maximum(farthest, (after - before).norm(dim=-1).amax(0) * focal_per_depth)
    return farthest


@pytest.mark.parametrize("strength", [0.1, 1.0])
def test_the_bound_holds_and_is_not_wasteful(strength: float) -> None:
    scene = moving_scene(strength)
    bound, real = largest_displacement_px(scene, CAMERA), moved_px(scene, CAMERA)
    assert bool((bound >= real * 0.999).all())
    assert float((bound / real).median()) < 5


def test_what_is_dropped_moved_by_less_than_promised() -> None:
    scene, log = moving_scene(1.0), RunLog()
    trimmed = prune_static_tracks(scene, CAMERA, 0.5, log)
    dropped = torch.ones(COUNT, dtype=torch.bool)
    dropped[trimmed.motion.moving_index] = False
    assert 20 < int(dropped.sum()) < COUNT - 20
    assert float(moved_px(scene, CAMERA)[dropped].max()) <= 0.5
    (omission,) = log.skipped
    assert omission.error == 0.5
    pixels, _ = project(CAMERA, trimmed.state_at(1.0).means[dropped])
    torch.testing.assert_close(pixels, project(CAMERA, scene.gaussians.means[dropped])[0])


def test_nothing_left_to_move_is_a_static_motion_and_nothing_to_drop_is_the_same_scene() -> None:
    scene = moving_scene(1.0)
    assert isinstance(prune_static_tracks(scene, CAMERA, 1e9, RunLog()).motion, StaticMotion)
    busy = replace(scene, motion=moving_scene(50.0).motion)
    tiny = prune_static_tracks(busy, CAMERA, 0.0, RunLog())
    assert tiny is busy
    still = replace(scene, motion=StaticMotion())
    assert prune_static_tracks(still, CAMERA, 1.0, RunLog()) is still


def test_gaussians_behind_the_camera_and_nan_keep_their_tracks() -> None:
    scene = moving_scene(1.0)
    behind = scene.gaussians.means.clone()
    behind[:, 2] = -1
    offsets = scene.motion.offsets.clone()
    offsets[0, 0, 0] = float("nan")
    odd = replace(
        scene,
        gaussians=replace(scene.gaussians, means=behind),
        motion=replace(scene.motion, offsets=offsets),
    )
    assert 0 in prune_static_tracks(odd, CAMERA, 0.05, RunLog()).motion.moving_index.tolist()


@pytest.mark.parametrize(
    ("noise_px", "asked_px", "want_px"), [(0.0, 0.1, 0.1), (2.0, 0.1, 8.0), (2.0, 9.0, 9.0)]
)
def test_what_a_model_cannot_tell_from_nothing_stands_still(
    noise_px: float, asked_px: float, want_px: float
) -> None:
    config = tiny_size()
    config = replace(config, deformation=replace(config.deformation, noise_px=noise_px))
    camera = pinhole(100.0, (64, 4 * config.size_px[1]))
    assert static_threshold_px(config, camera, asked_px) == want_px


def test_noise_must_be_a_number_of_pixels() -> None:
    with pytest.raises(ConfigError, match="noise_px: expected a number from 0 on, got -1"):
        replace(tiny_size().deformation, noise_px=-1.0)

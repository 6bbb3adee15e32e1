"""Dropping tracks: the promise is in pixels, so it is measured in pixels."""

from dataclasses import replace

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.generation.static_pruning import (
    deformation_threshold_px,
    largest_displacement_px,
    prune_static_tracks,
)
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import pinhole, project
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion

COUNT = 200
CAMERA = pinhole(200.0, (200, 200))


def moving_set(strength: float) -> tuple[Gaussians, KeyframeMotion]:
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
    return gaussians, motion


def rims(gaussians: Gaussians) -> torch.Tensor:
    """The six ends of the axes of every Gaussian, three standard deviations out: (6, n, 3)."""
    axes = quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None, :] * 3
    ends = axes.movedim(-1, 0)
    return torch.cat([gaussians.means + ends, gaussians.means - ends])


def displacement_px(gaussians: Gaussians, motion: KeyframeMotion) -> torch.Tensor:
    """How far centre and rim of each Gaussian move in the image, over all keys."""
    farthest = torch.zeros(COUNT)
    before = rims(gaussians)
    focal_per_depth = CAMERA.focal_px.max() / gaussians.means[:, 2]
    for time_s in (0.0, 1.0, 2.0):
        after = rims(motion.state_at(gaussians, time_s))
        farthest = torch.maximum(farthest, (after - before).norm(dim=-1).amax(0) * focal_per_depth)
    return farthest


@pytest.mark.parametrize("strength", [0.1, 1.0])
def test_the_bound_holds_and_is_not_wasteful(strength: float) -> None:
    gaussians, motion = moving_set(strength)
    bound = largest_displacement_px(gaussians, motion, CAMERA)
    real = displacement_px(gaussians, motion)
    assert bool((bound >= real * 0.999).all())
    assert float((bound / real).median()) < 5


def test_dropped_tracks_moved_by_at_most_the_threshold() -> None:
    gaussians, motion = moving_set(1.0)
    log = RunLog()
    pruned = prune_static_tracks(gaussians, motion, CAMERA, 0.5, log)
    dropped = torch.ones(COUNT, dtype=torch.bool)
    dropped[pruned.moving_index] = False
    assert 20 < int(dropped.sum()) < COUNT - 20
    assert float(displacement_px(gaussians, motion)[dropped].max()) <= 0.5
    (omission,) = log.skipped
    assert omission.error == 0.5
    pixels, _ = project(CAMERA, pruned.state_at(gaussians, 1.0).means[dropped])
    torch.testing.assert_close(pixels, project(CAMERA, gaussians.means[dropped])[0])


def test_without_any_track_the_motion_is_static_and_with_all_it_is_the_same() -> None:
    gaussians, motion = moving_set(1.0)
    pruned = prune_static_tracks(gaussians, motion, CAMERA, 1e9, RunLog())
    assert isinstance(pruned, StaticMotion) and pruned.time_range_s == (0.0, 2.0)
    busy = moving_set(50.0)[1]
    assert prune_static_tracks(gaussians, busy, CAMERA, 0.0, RunLog()) is busy
    still = StaticMotion()
    assert prune_static_tracks(gaussians, still, CAMERA, 1.0, RunLog()) is still


def test_gaussians_behind_the_camera_and_nan_keep_their_tracks() -> None:
    gaussians, motion = moving_set(1.0)
    behind, offsets = gaussians.means.clone(), motion.offsets.clone()
    behind[:, 2] = -1
    offsets[0, 0, 0] = float("nan")
    gaussians, motion = replace(gaussians, means=behind), replace(motion, offsets=offsets)
    assert 0 in prune_static_tracks(gaussians, motion, CAMERA, 0.05, RunLog()).moving_index.tolist()


@pytest.mark.parametrize(
    ("of_model", "asked", "expected"), [(0.0, 0.1, 0.1), (2.0, 0.1, 8.0), (2.0, 9.0, 9.0)]
)
def test_the_threshold_of_a_model_counts_in_pixels_of_its_size(
    of_model: float, asked: float, expected: float
) -> None:
    config = tiny_size()
    deformation = replace(config.deformation, static_threshold_px=of_model)
    config = replace(config, deformation=deformation)
    camera = pinhole(100.0, (64, 4 * config.size_px[1]))
    assert deformation_threshold_px(config, camera, asked) == expected


def test_a_threshold_must_be_a_number_of_pixels() -> None:
    with pytest.raises(ConfigError, match="static_threshold_px: expected a number from 0 on"):
        replace(tiny_size().deformation, static_threshold_px=-1.0)

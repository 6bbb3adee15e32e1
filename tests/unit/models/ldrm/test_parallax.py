"""Depth from parallax: exact on a textured plane, nothing without parallax, finite always."""

import math
from dataclasses import replace

import pytest
import torch
from depth_priors import DistanceOf
from plane_videos import DEPTH, INNER, SIZE, plane_video, sliding_cameras

from diff4splat.geometry.camera import Camera
from diff4splat.models.config.sizes import small_size
from diff4splat.models.ldrm.refinement import other_frames, parallax
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.parallax import LONGEST_STEP, STEPS, parallax_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.start_distance import with_start_distance
from diff4splat.models.ldrm.window_mean import window_mean


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.25])
def test_a_plane_is_found_from_a_wrong_depth(factor: float) -> None:
    video, truth = plane_video(0.05), torch.tensor(DEPTH).log()
    start = torch.full((1, 3, *SIZE), factor * DEPTH).log()
    found, confidence = parallax_depth(start, video)
    assert float((found - truth)[INNER].abs().max()) < 0.02
    assert float(confidence[INNER].min()) > 0.3


def test_without_parallax_nothing_changes() -> None:
    start = torch.randn(1, 3, *SIZE)
    found, confidence = parallax_depth(start, plane_video(0.0))
    torch.testing.assert_close(found, start)
    assert float(confidence.max()) < 1e-6


def test_one_frame_tells_nothing() -> None:
    video = plane_video(0.05, frames=1)
    start = torch.zeros(1, 1, *SIZE)
    found, confidence = parallax_depth(start, video)
    assert torch.equal(found, start) and not confidence.any()


def test_where_there_is_no_texture_the_correction_is_that_of_the_neighbourhood() -> None:
    start = torch.full((1, 3, *SIZE), 1.2 * DEPTH).log()
    found, confidence = parallax_depth(start, plane_video(0.05, bare=0.8))
    middle = (..., slice(22, 26), slice(30, 34))
    assert float(confidence[:, 0][middle].max()) < 0.1
    assert float((found[:, 0][middle] - torch.tensor(DEPTH).log()).abs().max()) < 0.08


@pytest.mark.parametrize("log_depth", [-20.0, 0.0, 20.0])
@pytest.mark.parametrize("step", [0.05, 1e4])
def test_extreme_depths_and_cameras_give_finite_bounded_corrections(
    log_depth: float, step: float
) -> None:
    video = replace(plane_video(0.05), cameras=sliding_cameras(step, 9))
    start = torch.full((1, 3, *SIZE), log_depth)
    found, confidence = parallax_depth(start, video)
    assert bool(found.isfinite().all()) and bool(confidence.isfinite().all())
    assert float((found - start).abs().max()) <= LONGEST_STEP * STEPS * 1.0001


def test_frames_that_do_not_belong_together_change_depth_by_bounded_steps() -> None:
    video = plane_video(0.05)
    start = torch.zeros(1, 3, *SIZE)
    found, _ = parallax_depth(start, replace(video, rgb=torch.rand_like(video.rgb).round()))
    assert bool(found.any()) and float(found.abs().max()) <= LONGEST_STEP * STEPS * 1.0001


def test_frames_beyond_the_ends_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    video, start = plane_video(0.05), torch.full((1, 3, *SIZE), 1.2 * DEPTH).log()
    usual = parallax_depth(start, video)[0][:, 1]
    monkeypatch.setattr(other_frames, "DISTANCES", (2, 4, 8, 16))
    torch.testing.assert_close(parallax_depth(start, video)[0][:, 1], usual)
    monkeypatch.setattr(other_frames, "DISTANCES", (2, 4))
    torch.testing.assert_close(parallax_depth(start, video)[0][:, 1], usual)


def test_points_out_of_the_other_frames_tell_nothing() -> None:
    video = plane_video(0.05)
    poses = video.cameras.world_from_camera.clone()
    poses[..., 0, 3] = 100.0 * torch.arange(9)
    poses[..., 1, 3] = 0.05 * torch.arange(9)
    start = torch.full((1, 3, *SIZE), DEPTH).log()
    away = replace(video, cameras=video.cameras.with_pose(poses))
    found, confidence = parallax_depth(start, away)
    assert torch.equal(found, start) and not confidence.any()


def test_what_covers_another_frame_hardly_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    video, truth = plane_video(0.05), torch.tensor(DEPTH).log()
    rgb = video.rgb.clone()
    torch.manual_seed(0)
    rgb[:, :, 8] = torch.rand(rgb[:, :, 8].shape).round()
    covered = replace(video, rgb=rgb)
    start = truth.expand(1, 3, *SIZE)

    def worst() -> float:
        return float((parallax_depth(start, covered)[0][:, 0] - truth)[INNER].abs().max())

    weighted = worst()
    monkeypatch.setattr(parallax, "RESIDUAL_SCALE", 1e6)
    assert weighted < 0.1 and worst() > 3 * weighted


def test_the_start_distance_has_the_depth_that_the_frames_agree_with() -> None:
    video, config = plane_video(0.05), small_size()

    prior = DistanceOf(lambda image: torch.full_like(image[:, :1], math.log(1.2 * DEPTH / 4)))
    start = with_start_distance(video, prior, config).start
    near = key_depth(start.prior, config.activation)
    assert float((near / DEPTH - 1.2).abs().max()) < 0.02
    found = key_depth(start.parallax, config.activation)[INNER]
    assert float((found / DEPTH - 1).abs().max()) < 0.02


def test_samples_of_a_batch_do_not_see_each_other() -> None:
    one, two = plane_video(0.05), plane_video(0.08)
    both = PosedVideo(rgb=torch.cat([one.rgb, two.rgb]), cameras=_together(one, two))
    start = torch.full((2, 3, *SIZE), 1.1 * DEPTH).log()
    together, _ = parallax_depth(start, both)
    alone = [parallax_depth(start[:1], video)[0] for video in (one, two)]
    torch.testing.assert_close(together, torch.cat(alone), atol=1e-5, rtol=1e-5)


def test_window_means_are_those_of_the_pixels_within_the_image() -> None:
    maps = torch.rand(1, 1, 5, 4)
    found = window_mean(maps, 3)
    assert float(found[0, 0, 2, 2]) == pytest.approx(float(maps[0, 0, 1:4, 1:4].mean()))
    assert float(found[0, 0, 0, 0]) == pytest.approx(float(maps[0, 0, :2, :2].mean()))


def _together(one: PosedVideo, two: PosedVideo) -> Camera:
    camera = one.cameras
    return replace(
        camera,
        focal_px=torch.cat([camera.focal_px, two.cameras.focal_px]),
        center_px=torch.cat([camera.center_px, two.cameras.center_px]),
        world_from_camera=torch.cat([camera.world_from_camera, two.cameras.world_from_camera]),
    )

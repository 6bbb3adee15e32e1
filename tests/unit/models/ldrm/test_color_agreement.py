"""How well a depth explains the other frames: the formula, and no value that is not finite."""

from dataclasses import replace

import pytest
import torch
from plane_videos import DEPTH, SIZE, plane_video
from torch import Tensor

from diff4splat.geometry.camera import project
from diff4splat.geometry.rays import camera_rays
from diff4splat.models.ldrm.refinement import other_frames
from diff4splat.models.ldrm.refinement.color_agreement import RESIDUAL_SCALE, ColorAgreement
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo

KEYS = 3
TRUTH = torch.full((KEYS, *SIZE), DEPTH).log()


def by_hand(video: PosedVideo, log_depth: Tensor, key: int) -> float:
    """Point by point, where a projected pixel centre has whole coordinates.

    The camera does not turn, so that a point at an infinite distance keeps its pixel.
    """
    cameras, rgb = video.cameras[0], video.rgb[0]
    points = camera_rays(cameras[4 * key]) * log_depth[key].exp()[..., None]
    world, own = points + cameras[4 * key].position, rgb[:, 4 * key].flatten(1)
    values = []
    for frame in {4 * key + sign * step for step in (2, 4, 8) for sign in (1, -1)}:
        if not 0 <= frame < rgb.shape[1]:
            continue
        pixels, _ = project(cameras[frame], world.flatten(0, 1))
        column, row = (pixels - 0.5).round().long().unbind(-1)
        inside = (column >= 0) & (column < SIZE[1]) & (row >= 0) & (row < SIZE[0])
        other = rgb[:, frame, row.clamp(0, SIZE[0] - 1), column.clamp(0, SIZE[1] - 1)]
        other = torch.where(inside, other, rgb[:, frame].flatten(1))
        values.append((other - own).square().mean(0))
    squared = torch.cat(values)
    return float((squared / (squared + RESIDUAL_SCALE**2)).mean())


def test_it_is_the_mean_of_robust_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    """The camera moves by whole pixels: a step of one pixel is DEPTH / focal."""
    monkeypatch.setattr(other_frames, "BLUR_PX", 1)
    video = plane_video(DEPTH / 60)
    torch.manual_seed(0)
    video = replace(video, rgb=torch.rand_like(video.rgb))
    found = ColorAgreement.of(video).error(TRUTH)
    expected = [by_hand(video, TRUTH, key) for key in range(KEYS)]
    torch.testing.assert_close(found, torch.tensor(expected), atol=2e-3, rtol=0)


def test_the_true_depth_has_the_least_error() -> None:
    agreement = ColorAgreement.of(plane_video(0.05))
    errors = [agreement.error(TRUTH + shift) for shift in (-0.3, -0.1, 0, 0.1, 0.3)]
    assert torch.stack(errors).argmin(0).tolist() == [2] * KEYS
    assert float(errors[2].max()) < 0.1 < float(errors[1].min())


@pytest.mark.parametrize("log_depth", [-80.0, 80.0])
def test_extreme_depths_give_finite_errors(log_depth: float) -> None:
    error = ColorAgreement.of(plane_video(0.05)).error(torch.full_like(TRUTH, log_depth))
    assert bool(error.isfinite().all()) and float(error.min()) >= 0 and float(error.max()) <= 1


def test_a_single_frame_has_no_error() -> None:
    error = ColorAgreement.of(plane_video(0.05, frames=1)).error(TRUTH[:1])
    assert error.tolist() == [0.0]


def test_to_leave_the_frame_is_no_gain() -> None:
    """So near that no other frame shows any point, against an infinite distance."""
    agreement = ColorAgreement.of(plane_video(0.05))
    nowhere = agreement.error(torch.full_like(TRUTH, -20.0))
    torch.testing.assert_close(nowhere, agreement.error(torch.full_like(TRUTH, 30.0)))
    assert bool((nowhere > agreement.error(TRUTH)).all())

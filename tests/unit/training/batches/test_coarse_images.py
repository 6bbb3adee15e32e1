"""Images reduced and enlarged again: only the video changes, and only its sharpness."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, stage_recipe

from diff4splat.errors import ShapeError
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.coarse_images import enlarged, with_coarse_images


def batch() -> ClipBatch:
    return make_batch(stage_recipe("video_diffusion"), (0, 1))


def test_detail_goes_and_means_stay() -> None:
    sharp = batch()
    soft = with_coarse_images(sharp, sharp.video.shape[3] // 2)
    assert soft.video.shape == sharp.video.shape and soft.video.dtype == torch.uint8
    before, after = (one.video.float() for one in (sharp, soft))
    assert abs(float(before.mean() - after.mean())) < 0.5
    steps = [one.diff(dim=3).abs().mean() for one in (before, after)]
    assert steps[1] < 0.9 * steps[0]


def test_nothing_but_the_video_changes() -> None:
    sharp = batch()
    soft = with_coarse_images(sharp, sharp.video.shape[3] // 4)
    for name in ("field", "moving", "depth", "target_rgb", "track_cell"):
        assert getattr(soft, name) is getattr(sharp, name)
    assert soft.cameras is sharp.cameras


def test_an_enlarged_batch_has_the_same_image_motion_and_mask() -> None:
    small = replace(batch(), moving=torch.rand(batch().moving.shape) > 0.5)
    large = enlarged(small, 2)
    for name, axes in (("video", (2, 3)), ("field", (3, 4)), ("moving", (-2, -1))):
        before, after = (getattr(one, name) for one in (small, large))
        expected = list(before.shape)
        for axis in axes:
            expected[axis] *= 2
        assert list(after.shape) == expected and after.dtype == before.dtype
    torch.testing.assert_close(large.field.mean((-2, -1)), small.field.mean((-2, -1)))
    assert torch.equal(large.moving[..., ::2, 1::2], small.moving)
    assert enlarged(small, 1) is small


def test_one_colour_stays_that_colour() -> None:
    sharp = batch()
    sharp.video[:] = torch.tensor([3, 128, 255], dtype=torch.uint8)
    assert torch.equal(with_coarse_images(sharp, 16).video, sharp.video)


def test_the_whole_side_is_the_batch_itself() -> None:
    sharp = batch()
    assert with_coarse_images(sharp, sharp.video.shape[3]) is sharp


@pytest.mark.parametrize("share", [3, 1.5])
def test_a_side_that_does_not_divide_is_refused(share: float) -> None:
    sharp = batch()
    with pytest.raises(ShapeError, match=r"correct data\.view_sides_px"):
        with_coarse_images(sharp, int(sharp.video.shape[3] / share) + 1)

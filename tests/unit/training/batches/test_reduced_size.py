"""Batches at a smaller size: images, motion and cameras of one clip stay together."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, stage_recipe

from diff4splat.errors import ShapeError
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.reduced_size import reduced


def half_moving() -> ClipBatch:
    """The left half moves, and one column more at every second row."""
    batch = make_batch(stage_recipe("video_diffusion"), (0, 1))
    moving = torch.zeros_like(batch.moving)
    moving[:, :, : moving.shape[-1] // 2] = True
    moving[:, ::2, moving.shape[-1] // 2] = True
    return replace(batch, moving=moving, field=torch.randn_like(batch.field))


def test_means_of_pixels_and_cells_and_halves_of_what_moves() -> None:
    batch = half_moving()
    height, width = batch.video.shape[2:4]
    small = reduced(batch, width // 2)
    assert small.video.shape[2:4] == (height // 2, width // 2) == small.cameras.size_px
    block = batch.video[:, :, :2, :2].double().mean((2, 3))
    assert bool(((small.video[:, :, 0, 0].double() - block).abs() <= 0.5).all())
    torch.testing.assert_close(
        small.field[..., 0, 0], batch.field[..., :2, :2].mean((-2, -1)), atol=1e-6, rtol=0
    )
    # A quarter of the pixels of the column beside the left half moves.
    expected = torch.arange(width // 2) < width // 4
    assert torch.equal(small.moving, expected.expand_as(small.moving))
    rays = (small.cameras.focal_px[..., 0] * 2, small.cameras.center_px * 2)
    torch.testing.assert_close(rays[0], batch.cameras.focal_px[..., 0])
    torch.testing.assert_close(rays[1], batch.cameras.center_px)


def test_the_whole_size_is_the_batch_itself() -> None:
    batch = half_moving()
    assert reduced(batch, batch.video.shape[3]) is batch


@pytest.mark.parametrize("share", [3, 1.5])
def test_a_side_that_does_not_divide_is_refused(share: float) -> None:
    batch = half_moving()
    side = int(batch.video.shape[3] / share) + 1
    with pytest.raises(ShapeError, match=r"correct data\.view_sides_px"):
        reduced(batch, side)

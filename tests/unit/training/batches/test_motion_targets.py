"""The true motion is that of the objects in the first frame."""

from dataclasses import replace

import torch

from diff4splat.data.clip import Clip, ClipMetadata, Tracks, View
from diff4splat.geometry.camera import pinhole
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.training.batches.augment import mirrored
from diff4splat.training.batches.motion_targets import (
    cell_means,
    extend_to_all_cells,
    moving_mask,
    pixel_motion,
)

SIDE, FRAMES, DEPTH = 16, 9, 4.0


def square(way: tuple[float, float, float]) -> Clip:
    """A square of 8 pixels in the upper left that goes ``way``, before something that stands."""
    cameras = pinhole(20.0, (SIDE, SIDE)).with_pose(torch.eye(4).repeat(FRAMES, 1, 1))
    instances = torch.ones(FRAMES, SIDE, SIDE, dtype=torch.uint8)
    instances[:, :8, :8] = 2
    progress = torch.linspace(0, 1, FRAMES)[:, None, None]
    start = torch.tensor([[-1.0, -1.0, DEPTH], [-0.5, -0.5, DEPTH], [1.0, 1.0, DEPTH]])
    ways = torch.tensor([way, way, (0.0, 0.0, 0.0)])
    places = torch.tensor([[3.0, 3.0], [5.0, 5.0], [12.0, 12.0]]).repeat(FRAMES, 1, 1)
    view = View(
        rgb=torch.zeros(FRAMES, SIDE, SIDE, 3, dtype=torch.uint8),
        depth=torch.full((FRAMES, SIDE, SIDE), DEPTH),
        cameras=cameras,
        instances=instances,
        track_uv=places,
        track_visible=torch.ones(FRAMES, 3, dtype=torch.bool),
    )
    tracks = Tracks(
        positions=start + progress * ways,
        instances=torch.tensor([2, 2, 1], dtype=torch.uint8),
        found_at=torch.zeros(3, 2, dtype=torch.long),
    )
    note = ClipMetadata(identifier="square", source="test", license="CC0-1.0")
    return Clip(note=note, times_s=torch.arange(FRAMES) / 8, views=(view,), tracks=tracks)


def cell_motion(clip: Clip, input_stride: int) -> torch.Tensor:
    """Means of the pixels' motion over cells."""
    return cell_means(pixel_motion(clip, input_stride))


def test_an_object_goes_where_its_points_go() -> None:
    found = cell_motion(square((0.8, 0.0, -0.4)), 1)
    assert found.shape == (3, 3, 4, 4)
    wanted = torch.tensor([0.8, 0.0, -0.4]) / DEPTH / UNIT
    for time, share in enumerate((0.0, 0.5, 1.0)):
        inside = found[:, time, :2, :2].flatten(1).mT
        torch.testing.assert_close(inside, (share * wanted).expand(4, 3))
    assert not bool(found[:, :, 2:].any()) and not bool(found[:, :, :, 2:].any())


def test_videos_may_skip_frames() -> None:
    whole, halved = (cell_motion(square((0.8, 0.0, 0.0)), stride) for stride in (1, 2))
    assert halved.shape[1] == 2
    torch.testing.assert_close(halved[:, 1], whole[:, 2])


def test_in_a_mirror_it_goes_the_other_way() -> None:
    clip = square((0.8, 0.2, 0.0))
    flip = torch.tensor([-1.0, 1.0, 1.0])[:, None, None, None]
    torch.testing.assert_close(cell_motion(mirrored(clip), 1), flip * cell_motion(clip, 1).flip(-1))


def test_without_depth_masks_or_tracks_nothing_moves() -> None:
    clip = square((0.8, 0.0, 0.0))
    (view,) = clip.views
    blind = replace(view, depth=torch.zeros_like(view.depth))
    maskless = replace(view, instances=None)
    for poor in (
        replace(clip, tracks=None),
        replace(clip, views=(blind,)),
        replace(clip, views=(maskless,)),
    ):
        found = cell_motion(poor, 1)
        assert not bool(found.any()) and bool(found.isfinite().all())


def test_what_hardly_moves_stands() -> None:
    assert not bool(cell_motion(square((0.01, 0.0, 0.0)), 1).any())


def test_cells_are_means_of_pixels() -> None:
    motion = pixel_motion(square((0.8, 0.3, -0.4)), 1)
    cells = cell_means(motion)
    for row in range(4):
        for column in range(4):
            own = motion[:, :, 4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
            torch.testing.assert_close(cells[:, :, row, column], own.mean((2, 3)))


def test_what_moves_is_told_pixel_by_pixel() -> None:
    moving = moving_mask(pixel_motion(square((0.8, 0.0, 0.0)), 1))
    assert bool(moving[:8, :8].all()) and int(moving.sum()) == 64
    assert not moving_mask(pixel_motion(square((0.0, 0.0, 0.0)), 1)).any()


def test_all_cells_go_as_the_nearest_that_moves() -> None:
    motion = pixel_motion(square((0.8, 0.2, -0.4)), 1)
    field = extend_to_all_cells(motion, moving_mask(motion))
    assert field.shape == (3, 3, 4, 4)
    for time in range(3):
        wanted = motion[:, time, 0, 0][:, None, None]
        torch.testing.assert_close(field[:, time], wanted.expand(3, 4, 4))


def test_a_cell_goes_as_its_moving_pixels_do_and_not_as_their_mean_with_the_others() -> None:
    motion = torch.zeros(3, 2, 8, 8)
    motion[0, 1, 3, 3] = 2.0
    motion[1, 1, 7, 7] = -1.0
    field = extend_to_all_cells(motion, moving_mask(motion))
    assert field[:, 1, 0, 0].tolist() == [2.0, 0.0, 0.0]
    assert field[:, 1, 1, 1].tolist() == [0.0, -1.0, 0.0]
    assert not field[:, 0].any()


def test_where_nothing_moves_nothing_is_continued() -> None:
    motion = torch.zeros(3, 3, 16, 16)
    assert not extend_to_all_cells(motion, moving_mask(motion)).any()

"""Image and fill as one set: guesses that hide the fill go, what the image shows stays."""

import pytest
import torch
from image_layers import FOCAL_PX
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet
from diff4splat.generation.layered_image.types import NO_PIXEL
from diff4splat.generation.scene_assembly import OCCLUSION_MARGIN, combine, hides_fill, joined
from diff4splat.generation.video.hidden_cells import FillGrid
from diff4splat.generation.video.video_fill import VideoFill
from diff4splat.geometry.camera import pinhole
from diff4splat.models.ldrm.gaussian_head import PixelBase
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion

SIZE_PX, DEPTH = (4, 6), 5.0


def some(means: Tensor, moving: tuple[int, ...] = ()) -> GaussianSet:
    """Gaussians whose pixel index counts them; those of ``moving`` are displaced by their row."""
    count = len(means)
    gaussians = Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(count, 1),
        scales=torch.full((count, 3), 0.1),
        opacities=torch.full((count,), 0.5),
        sh=torch.zeros(count, 1, 3),
    )
    motion = StaticMotion(time_range_s=(0.0, 1.0))
    if moving:
        rows = torch.tensor(moving, dtype=torch.float32)
        motion = KeyframeMotion(
            key_times_s=torch.tensor([0.0, 1.0]),
            moving_index=torch.tensor(moving),
            offsets=torch.stack([0 * rows, rows + 1])[..., None].repeat(1, 1, 3),
            rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(2, len(moving), 1),
            log_scale_offsets=torch.zeros(2, len(moving), 3),
        )
    return GaussianSet(gaussians=gaussians, motion=motion, pixel_index=torch.arange(count))


def grid(filled: Tensor, poses: Tensor | None = None) -> FillGrid:
    depth = torch.full(filled.shape, DEPTH)
    poses = torch.eye(4).repeat(len(filled), 1, 1) if poses is None else poses
    base = PixelBase(
        rgb=torch.zeros(*filled.shape, 3),
        distance=depth,
        opacity=depth / DEPTH,
        cameras=pinhole(FOCAL_PX, SIZE_PX).with_pose(poses),
    )
    return FillGrid(base=base, depth=depth, filled=filled)


def one_cell(row: int = 1, column: int = 4) -> Tensor:
    filled = torch.zeros(1, *SIZE_PX, dtype=torch.bool)
    filled[0, row, column] = True
    return filled


def point(row: int, column: int, z: float) -> list[float]:
    """What the first camera sees in the middle of a cell."""
    return [(column + 0.5 - 3) / FOCAL_PX * z, (row + 0.5 - 2) / FOCAL_PX * z, z]


@pytest.mark.parametrize(
    ("row", "column", "z", "hides"),
    [
        (1, 4, 1.0, True),
        (1, 4, DEPTH, True),
        (1, 4, 0.99 * OCCLUSION_MARGIN * DEPTH, True),
        (1, 4, 1.01 * OCCLUSION_MARGIN * DEPTH, False),
        (1, 4, -1.0, False),
        (1, 3, 1.0, False),
        (0, 4, 1.0, False),
        (1, 10, 1.0, False),
        (-5, 4, 1.0, False),
    ],
)
def test_a_point_hides_the_fill_in_front_of_a_filled_cell(
    row: int, column: int, z: float, hides: bool
) -> None:
    means = torch.tensor([point(row, column, z)])
    assert hides_fill(means, grid(one_cell())).tolist() == [hides]


def test_any_camera_of_the_grid_decides() -> None:
    filled = torch.cat([torch.zeros_like(one_cell()), one_cell()])
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[1, 0, 3] = 100.0
    there = torch.tensor([point(1, 4, 2.0)])
    assert not hides_fill(there, grid(filled, poses)).any()
    assert bool(hides_fill(there + torch.tensor([100.0, 0.0, 0.0]), grid(filled, poses)).all())


def test_points_that_are_nowhere_hide_nothing() -> None:
    means = torch.tensor([[0.0, 0.0, 0.0], [float("nan")] * 3, [1e30, 0.0, 1e-30]])
    everything = torch.ones(1, *SIZE_PX, dtype=torch.bool)
    assert not hides_fill(means, grid(everything)).any()
    assert len(hides_fill(means[:0], grid(everything))) == 0


def filling(gaussians: GaussianSet, filled: Tensor) -> VideoFill:
    """The Gaussians of the filled cells."""
    cell_index = filled.flatten().nonzero()[:, 0]
    return VideoFill(gaussians=gaussians, cell_index=cell_index, grid=grid(filled))


def test_guesses_in_front_go_and_what_the_image_shows_stays() -> None:
    means = torch.tensor([point(1, 4, 2.0), point(0, 0, 2.0), point(1, 4, 2.0), point(1, 4, 9.0)])
    image = some(means, moving=(0, 2, 3))
    fill = some(torch.tensor([point(1, 4, DEPTH)]), moving=(0,))
    fill = GaussianSet(
        gaussians=fill.gaussians, motion=fill.motion, pixel_index=torch.tensor([NO_PIXEL])
    )
    both = combine(image, 2, filling(fill, one_cell()))
    kept = torch.tensor([0, 1, 3])
    wanted = torch.cat([means[kept], fill.gaussians.means])
    assert torch.equal(both.gaussians.means, wanted)
    assert both.pixel_index.tolist() == [0, 1, 3, NO_PIXEL]
    offsets = both.motion.state_at(both.gaussians, 1.0).means - wanted
    torch.testing.assert_close(offsets[:, 0], torch.tensor([1.0, 0.0, 4.0, 1.0]))


def test_an_empty_fill_changes_nothing() -> None:
    image = some(torch.tensor([point(1, 4, 2.0), point(1, 4, 9.0)]), moving=(1,))
    nothing = filling(some(torch.zeros(0, 3)), one_cell() & False)
    both = combine(image, 0, nothing)
    assert torch.equal(both.gaussians.means, image.gaussians.means)
    assert torch.equal(both.motion.moving_index, image.motion.moving_index)


def test_joined_sets_keep_their_order_and_their_motion() -> None:
    left, right = some(torch.rand(3, 3), moving=(2,)), some(torch.rand(2, 3))
    for first, second, moving in ((left, right, [2]), (right, left, [4])):
        both = joined(first, second)
        means = torch.cat([first.gaussians.means, second.gaussians.means])
        assert torch.equal(both.gaussians.means, means)
        assert both.motion.moving_index.tolist() == moving
    assert isinstance(joined(right, right).motion, StaticMotion)

"""Which cells of a generated video are filled, and at which depth."""

import math

import pytest
import torch
from image_layers import FOCAL_PX, random_depth
from torch import Tensor

from diff4splat.generation.video.hidden_cells import (
    FillGrid,
    at_grid,
    depth_ratio,
    full_grid,
    hidden_grid,
    in_front_of_image,
    middle_mean,
)
from diff4splat.generation.video.render_condition import RenderedImage
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase

SIZE_PX, FRAMES = (5, 7), 3


def cameras(step: float = 0.0) -> Camera:
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    poses[:, 0, 3] = step * torch.arange(FRAMES)
    return pinhole(FOCAL_PX, SIZE_PX).with_pose(poses)


def base(depth: Tensor, step: float = 0.0) -> PixelBase:
    return PixelBase(
        rgb=torch.rand(*depth.shape, 3),
        distance=distance_from_depth(cameras(step), depth),
        opacity=torch.ones_like(depth),
        cameras=cameras(step),
    )


def grid(depth: Tensor, step: float = 0.0) -> FillGrid:
    everything = torch.ones_like(depth, dtype=torch.bool)
    return FillGrid(base=base(depth, step), depth=depth, filled=everything)


def shown(valid: Tensor, depth: Tensor) -> RenderedImage:
    rgb = torch.rand(*depth.shape, 3)
    return RenderedImage(rgb=rgb, valid=valid, depth=depth, surface_depth=depth)


def depths(seed: int = 0) -> Tensor:
    return torch.stack(
        [random_depth(*SIZE_PX, (2.0, 9.0), seed + frame) for frame in range(FRAMES)]
    )


def test_the_whole_grid_is_filled_at_the_depth_that_ldrm_predicts() -> None:
    plane, raw = torch.full((FRAMES, *SIZE_PX), 4.0), torch.randn(12, FRAMES, *SIZE_PX)
    config = ActivationConfig()
    whole = full_grid(raw, base(plane), config)
    limit = config.log_distance_limit
    wanted = 4.0 * (limit * (raw[-1] / limit).tanh()).exp()
    torch.testing.assert_close(whole.depth, wanted)
    assert bool(whole.filled.all()) and whole.cameras.batch_shape == (FRAMES,)


def test_the_ratio_is_the_mean_of_the_middle_half_of_shared_cells() -> None:
    predicted, reference = depths(), depths(7)
    valid = torch.rand(FRAMES, *SIZE_PX) < 0.5
    reference[1, :2] = 0.0
    ratio = depth_ratio(predicted, shown(valid, reference))
    assert ratio.shape == (FRAMES, 1, 1)
    for frame in range(FRAMES):
        shares = sorted(
            float(reference[frame, row, column] / predicted[frame, row, column])
            for row in range(SIZE_PX[0])
            for column in range(SIZE_PX[1])
            if bool(valid[frame, row, column]) and float(reference[frame, row, column]) > 0
        )
        middle = shares[len(shares) // 4 : len(shares) - len(shares) // 4]
        assert float(ratio[frame]) == pytest.approx(sum(middle) / len(middle))


def test_frames_that_share_no_cell_keep_their_scale() -> None:
    valid = torch.zeros(FRAMES, *SIZE_PX, dtype=torch.bool)
    assert torch.equal(depth_ratio(depths(), shown(valid, depths())), torch.ones(FRAMES, 1, 1))
    assert torch.equal(depth_ratio(depths(), shown(~valid, 0 * depths())), torch.ones(FRAMES, 1, 1))


def test_cells_in_front_of_the_image_agree_with_plain_loops() -> None:
    step, depth, image = 0.137, depths(), depths(5)[0]
    actual = in_front_of_image(depth, cameras(step), image)
    wanted = torch.zeros_like(actual)
    height, width = SIZE_PX
    for frame in range(FRAMES):
        for row in range(height):
            for column in range(width):
                z = float(depth[frame, row, column])
                x = (column + 0.5 - width / 2) / FOCAL_PX * z + step * frame
                u = x / z * FOCAL_PX + width / 2
                if 0 < u < width:
                    wanted[frame, row, column] = z < float(image[row, math.floor(u)])
    # In the first frame every cell lies on its own pixel.
    assert torch.equal(actual[1:], wanted[1:])
    assert bool(wanted[1:].any()) and not bool(wanted[1:].all())


def test_hidden_cells_are_filled_at_the_scale_of_the_image() -> None:
    depth = torch.full((FRAMES, *SIZE_PX), 2.0)
    valid = torch.ones(FRAMES, *SIZE_PX, dtype=torch.bool)
    valid[1, :, 5:] = valid[2, :, 3:] = False
    # The image is a plane at 6; two columns further right a frame.
    step = 2 * 6.0 / FOCAL_PX
    hidden = hidden_grid(grid(depth, step), shown(valid, 6.0 * valid))
    torch.testing.assert_close(hidden.depth, torch.full_like(depth, 6.0))
    torch.testing.assert_close(hidden.base.distance, 3 * base(depth, step).distance)
    assert not hidden.filled[0].any()
    assert torch.equal(hidden.filled[1], ~valid[1])
    wanted = torch.zeros(SIZE_PX, dtype=torch.bool)
    wanted[:, 5:] = True
    assert torch.equal(hidden.filled[2], wanted), "the frame before fills the other cells"


def test_nothing_is_filled_where_the_image_shows_everything() -> None:
    valid = torch.ones(FRAMES, *SIZE_PX, dtype=torch.bool)
    assert not hidden_grid(grid(depths(), 0.1), shown(valid, depths(3))).filled.any()


def test_hidden_cells_in_front_of_the_image_are_not_filled() -> None:
    valid = torch.ones(FRAMES, *SIZE_PX, dtype=torch.bool)
    valid[1, 1:4, 2:5] = False
    image = torch.full((FRAMES, *SIZE_PX), 6.0)
    for factor, filled in ((0.8, False), (1.2, True)):
        depth = torch.full((FRAMES, *SIZE_PX), 6.0)
        depth[1, 1:4, 2:5] *= factor
        hidden = hidden_grid(grid(depth), shown(valid, image))
        assert bool(hidden.filled[1, 1:4, 2:5].all()) is filled
        assert int(hidden.filled.sum()) == 9 * filled


def test_the_render_is_taken_at_frames_and_cells() -> None:
    depth, surface_depth = torch.rand(2, 5, 8, 12)
    rendered = RenderedImage(
        rgb=torch.rand(5, 8, 12, 3),
        valid=torch.rand(5, 8, 12) < 0.5,
        depth=depth,
        surface_depth=surface_depth,
    )
    cells = at_grid(rendered, torch.tensor([0, 4]), 2)
    assert torch.equal(cells.rgb, rendered.rgb[::4, ::2, ::2])
    assert torch.equal(cells.valid, rendered.valid[::4, ::2, ::2])
    assert torch.equal(cells.depth, rendered.depth[::4, ::2, ::2])
    assert torch.equal(cells.surface_depth, rendered.surface_depth[::4, ::2, ::2])


def test_the_ratio_survives_outliers_and_hardly_moves_by_one_cell_more() -> None:
    values = torch.cat([torch.full((40,), 1.0), torch.full((40,), 2.0), torch.tensor([900.0])])
    one_more = torch.cat([values, torch.tensor([2.0])])
    assert 1.4 < float(middle_mean(values)) < 1.6
    assert abs(float(middle_mean(one_more) - middle_mean(values))) < 0.02
    assert float(middle_mean(torch.tensor([3.0]))) == 3

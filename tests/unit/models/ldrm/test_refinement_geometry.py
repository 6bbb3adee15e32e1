"""Warping, comparison of depths, coverage and surroundings, against projection and loops."""

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.generation.layered_image.border.extension import BEHIND, border_extension
from diff4splat.generation.layered_image.visibility import visible_in_earlier_frame
from diff4splat.geometry.camera import Camera, pinhole, project, stack_cameras
from diff4splat.geometry.depth import distance_from_depth, unproject
from diff4splat.geometry.rays import world_rays
from diff4splat.models.blocks.conv_block import convex_upsample
from diff4splat.models.ldrm.refinement.cost_volume import UNSEEN, cost_volume
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.warping import other_pixels

SIZE = (8, 12)


def cameras(*shifts: float, size: tuple[int, int] = SIZE) -> Camera:
    poses = torch.eye(4, dtype=torch.float64).repeat(len(shifts), 1, 1)
    poses[:, 0, 3] = torch.tensor(shifts)
    return pinhole(10.0, size, torch.float64).with_pose(poses)


def test_warped_pixels_are_projections_of_unprojected_points() -> None:
    seeing, other = cameras(0.0, 0.2), cameras(0.5, -0.3)
    depth = torch.rand(2, *SIZE, dtype=torch.float64) * 3 + 2
    pixels, relative = other_pixels(seeing, other, 1 / depth[:, None])
    want, z = project(other, unproject(seeing, depth).flatten(1, 2))
    want = 2 * want / torch.tensor([12.0, 8.0]) - 1
    torch.testing.assert_close(pixels[:, 0].flatten(1, 2), want)
    torch.testing.assert_close((relative[:, 0] * depth).flatten(1), z)


def test_agreement_of_a_textured_plane_is_greatest_at_its_depth() -> None:
    depth, shifts = 4.0, (0.0, 0.1, 0.4, 0.6, 0.8)
    rows = []
    for shift in shifts:
        view = cameras(shift)
        point = unproject(view, torch.full((1, *SIZE), depth, dtype=torch.float64))[0]
        wave = point[..., 0] * 4
        rows.append(torch.stack([wave.sin(), wave.cos()]))
    batch = cameras(*shifts)
    batch = Camera(
        focal_px=batch.focal_px[None],
        center_px=batch.center_px[None],
        world_from_camera=batch.world_from_camera[None],
        size_px=SIZE,
    )
    inverse = torch.tensor([1 / 10, 1 / 6, 1 / 4, 1 / 3, 1 / 2], dtype=torch.float64)
    found = cost_volume(torch.stack(rows)[None], batch, inverse)[0, 0, :5, :, 3:9]
    assert found.shape[0] == 5 and bool((found.argmax(0) == 2).all())


def test_one_frame_has_nothing_to_be_compared_with() -> None:
    one = cameras(0.0)
    one = one.with_pose(one.world_from_camera[None])
    found = cost_volume(
        torch.rand(1, 1, 2, *SIZE, dtype=torch.float64), one, torch.ones(3).double()
    )
    assert found.shape == (1, 1, 6, *SIZE) and bool((found == UNSEEN).all())


def test_a_static_plane_is_covered_and_what_lies_elsewhere_is_not() -> None:
    depth = torch.full((2, *SIZE), 4.0, dtype=torch.float64)
    found = visible_in_earlier_frame(depth, cameras(0.0, 0.8))
    assert not found[0].any()
    assert bool(found[1, :, :10].all()) and not bool(found[1, :, 10:].any())
    depth[1, 2, 3] = 3.0
    assert not visible_in_earlier_frame(depth, cameras(0.0, 0.8))[1, 2, 3]


def test_enlargement_is_a_weighted_mean_of_neighbours() -> None:
    maps, weights = torch.randn(1, 2, 3, 2).double(), torch.randn(1, 144, 3, 2).double()
    got = convex_upsample(maps, weights)
    for y in range(12):
        for x in range(8):
            row, column, sub = y // 4, x // 4, (y % 4) * 4 + x % 4
            share = weights[0, sub::16, row, column].softmax(0)
            want = sum(
                share[3 * i + j]
                * maps[0, :, min(max(row + i - 1, 0), 2), min(max(column + j - 1, 0), 1)]
                for i in range(3)
                for j in range(3)
            )
            torch.testing.assert_close(got[0, :, y, x], want)


def test_border_cells_lie_on_the_rays_of_the_image() -> None:
    camera = pinhole(10.0, (8, 12))
    layer = border_extension(torch.rand(8, 12, 3), torch.full((8, 12), 2.0), camera, 4)
    assert layer.depth.shape == layer.camera.size_px == (10, 11)
    cameras = stack_cameras([layer.camera])
    distance = distance_from_depth(cameras, layer.depth[None])[0, 4:-4, 4:-4]
    inner = stack_cameras([camera.resized((2, 3))])
    own = distance_from_depth(camera, torch.full((8, 12), 2.0))
    want = torch.nn.functional.avg_pool2d(own[None], 4)[0] * BEHIND
    torch.testing.assert_close(distance, want)
    _, rays = world_rays(cameras)
    torch.testing.assert_close(rays[0, 4:-4, 4:-4], world_rays(inner)[1][0])


def test_a_posed_video_needs_a_camera_for_every_frame() -> None:
    one = cameras(0.0, 0.1)
    batch = one.with_pose(one.world_from_camera[None])
    with pytest.raises(ShapeError, match=r"PosedVideo.cameras: expected .* \(1, 5, 8, 12\), got"):
        PosedVideo(rgb=torch.zeros(1, 3, 5, *SIZE), cameras=batch)

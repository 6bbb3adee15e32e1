"""Fine borders of key frames: around each, and nowhere that another frame sees."""

import torch
from image_layers import FOCAL_PX

from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.generation.video.keyframe_borders import keyframe_borders
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.rays import world_rays

SIDE, DEPTH = 16, 4.0
WIDE = (SIDE + 2 * (SIDE // 8)) ** 2 - SIDE**2


def borders(step_px: float, keys: int = 3) -> list[ImageLayer]:
    """Of key frames side by side, ``step_px`` pixels of the plane at DEPTH apart."""
    poses = torch.eye(4).repeat(keys, 1, 1)
    poses[:, 0, 3] = step_px * DEPTH / FOCAL_PX * torch.arange(keys)
    cameras = pinhole(FOCAL_PX, (SIDE, SIDE)).with_pose(poses)
    depth = torch.full((keys, SIDE, SIDE), DEPTH)
    return list(keyframe_borders(torch.rand(keys, SIDE, SIDE, 3), depth, cameras))


def test_one_frame_has_a_whole_border_behind_its_pixels() -> None:
    (border,) = borders(0.0, keys=1)
    assert int(border.mask.sum()) == WIDE
    assert float(border.depth[border.mask].min()) > DEPTH


def test_equal_cameras_have_one_border() -> None:
    counts = [int(border.mask.sum()) for border in borders(0.0)]
    assert counts == [WIDE, 0, 0]


def test_no_cell_lies_where_another_key_frame_sees() -> None:
    found = borders(5.0)
    poses = torch.eye(4).repeat(3, 1, 1)
    poses[:, 0, 3] = 5.0 * DEPTH / FOCAL_PX * torch.arange(3)
    cameras = pinhole(FOCAL_PX, (SIDE, SIDE)).with_pose(poses)
    for key, border in enumerate(found):
        assert bool(border.mask.any())
        origins, directions = world_rays(border.camera)
        points = (origins + directions * (border.depth / directions[..., 2])[..., None])[
            border.mask
        ]
        for other in range(3):
            if other != key:
                pixels, z = project(cameras[other], points)
                inside = ((pixels > 0.01) & (pixels < SIDE - 0.01)).all(-1) & (z > 0)
                assert not bool(inside.any())


def test_borders_pass_no_gradient() -> None:
    depth = torch.full((1, SIDE, SIDE), DEPTH, requires_grad=True)
    cameras = pinhole(FOCAL_PX, (SIDE, SIDE)).with_pose(torch.eye(4)[None])
    (border,) = keyframe_borders(torch.rand(1, SIDE, SIDE, 3), depth, cameras)
    assert not border.depth.requires_grad

"""Which pixels of later frames an earlier one sees: against plain loops, and in plain cases."""

import math

import pytest
import torch
from image_layers import FAR_RANGES, FOCAL_PX, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.visibility import TOLERANCE, visible_in_earlier_frame
from diff4splat.geometry.camera import Camera, pinhole

SIZE_PX, FRAMES = (5, 7), 4


def cameras(count: int = FRAMES, step: float = 0.0, turn_rad: float = 0.0) -> Camera:
    """To the right by ``step`` and about the vertical by ``turn_rad`` a frame."""
    poses = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    for index in range(count):
        cos, sin = math.cos(index * turn_rad), math.sin(index * turn_rad)
        poses[index, :3, :3] = torch.tensor([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
        poses[index, 0, 3] = index * step
    return pinhole(FOCAL_PX, SIZE_PX, torch.float64).with_pose(poses)


def oracle(depth: Tensor, path: Camera, counted: Tensor | None = None) -> Tensor:
    """Unproject one pixel, look it up in every earlier frame."""
    height, width = SIZE_PX
    visible = torch.zeros_like(depth, dtype=torch.bool)
    poses = path.world_from_camera
    for key in range(1, len(depth)):
        for row in range(height):
            for column in range(width):
                z = float(depth[key, row, column])
                x = (column + 0.5 - width / 2) / FOCAL_PX * z
                y = (row + 0.5 - height / 2) / FOCAL_PX * z
                world = poses[key] @ torch.tensor([x, y, z, 1.0], dtype=torch.float64)
                for earlier in range(key):
                    local = (torch.linalg.inv(poses[earlier]) @ world).tolist()
                    if local[2] <= 1e-3 * z:
                        continue
                    u = local[0] / local[2] * FOCAL_PX + width / 2
                    v = local[1] / local[2] * FOCAL_PX + height / 2
                    if not (0 < u < width and 0 < v < height):
                        continue
                    there = (earlier, int(v), int(u))
                    agrees = abs(local[2] - float(depth[there])) < TOLERANCE * local[2]
                    if agrees and (counted is None or bool(counted[there])):
                        visible[key, row, column] = True
    return visible


@pytest.mark.parametrize(("step", "turn_rad"), [(0.137, 0.0), (0.0, 0.031), (-0.213, 0.053)])
@pytest.mark.parametrize("masked", [False, True])
def test_it_agrees_with_plain_loops(step: float, turn_rad: float, masked: bool) -> None:
    depth = torch.stack([random_depth(*SIZE_PX, (3.0, 3.6), seed) for seed in range(FRAMES)])
    counted = torch.rand(FRAMES, *SIZE_PX) < 0.5 if masked else None
    path = cameras(step=step, turn_rad=turn_rad)
    actual = visible_in_earlier_frame(depth.double(), path, counted)
    wanted = oracle(depth.double(), path, counted)
    assert torch.equal(actual, wanted)
    assert bool(wanted.any()) and not bool(wanted[1:].all())


def test_one_camera_sees_everything_again() -> None:
    depth = random_depth(*SIZE_PX, (1.0, 9.0)).double().expand(FRAMES, *SIZE_PX)
    visible = visible_in_earlier_frame(depth, cameras())
    assert not visible[0].any() and bool(visible[1:].all())


def test_another_depth_is_another_surface() -> None:
    depth = torch.full((2, *SIZE_PX), 4.0, dtype=torch.float64)
    for factor, agrees in ((1 + 0.9 * TOLERANCE, True), (1 + 1.2 * TOLERANCE, False)):
        depth[1] = 4.0 * factor
        assert bool(visible_in_earlier_frame(depth, cameras(2))[1].all()) is agrees


def test_only_counted_pixels_count() -> None:
    depth = torch.full((3, *SIZE_PX), 4.0, dtype=torch.float64)
    counted = torch.zeros(3, *SIZE_PX, dtype=torch.bool)
    assert not visible_in_earlier_frame(depth, cameras(3), counted).any()
    counted[0, 2, 3] = counted[1, 4, 4] = counted[2, 0, 0] = True
    visible = visible_in_earlier_frame(depth, cameras(3), counted)
    assert torch.equal(visible[1], counted[0])
    assert torch.equal(visible[2], counted[0] | counted[1])
    everything = torch.ones_like(counted)
    unmasked = visible_in_earlier_frame(depth, cameras(3))
    assert torch.equal(visible_in_earlier_frame(depth, cameras(3), everything), unmasked)


def test_points_behind_or_beside_the_earlier_camera_are_not_visible() -> None:
    depth = torch.full((2, *SIZE_PX), 4.0, dtype=torch.float64)
    for path in (cameras(2, turn_rad=math.pi), cameras(2, step=100.0)):
        assert not visible_in_earlier_frame(depth, path).any()


@pytest.mark.parametrize("limits", FAR_RANGES)
def test_any_depth_gives_an_answer(limits: tuple[float, float]) -> None:
    depth = torch.stack([random_depth(*SIZE_PX, limits, seed) for seed in range(2)]).double()
    assert not visible_in_earlier_frame(depth, cameras(2, step=0.1))[0].any()
    assert not visible_in_earlier_frame(depth[:1], cameras(1)).any()

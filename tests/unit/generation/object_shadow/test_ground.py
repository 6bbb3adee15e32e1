"""Where a shadow lies on the ground, and where it is after a displacement."""

import math

import pytest
import torch

from diff4splat.generation.object_shadow.ground import (
    IN_FRONT,
    along_plane,
    ground_normal,
    on_ground,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.depth import unproject

CAMERA = pinhole(40.0, (32, 48))
HEIGHT = 1.5


def ground_depth(height: float = HEIGHT) -> torch.Tensor:
    """Of a level plane below the camera; far above the horizon."""
    down = (torch.arange(32) + 0.5 - 16) / 40
    depth = torch.where(down > 0.05, height / down.clamp_min(1e-3), 100.0)
    return depth[:, None].expand(32, 48).clone()


def points(rows: slice = slice(22, 30)) -> torch.Tensor:
    return unproject(CAMERA, ground_depth())[rows, 10:30].flatten(0, 1)


def test_the_normal_of_a_plane() -> None:
    normal = ground_normal(points(), torch.ones(len(points())))
    assert torch.allclose(normal.abs(), torch.tensor([0.0, 1.0, 0.0]), atol=1e-5)


def test_a_wall_does_not_tilt_it() -> None:
    torch.manual_seed(0)
    wall = torch.stack([torch.rand(60), -torch.rand(60) * 2 + HEIGHT, torch.full((60,), 4.0)], -1)
    both = torch.cat([points(), wall])
    normal = ground_normal(both, torch.ones(len(both)))
    assert abs(float(normal[1])) > math.cos(math.radians(5))


@pytest.mark.parametrize("count", [1, 2])
def test_few_points_have_a_unit_normal(count: int) -> None:
    normal = ground_normal(points()[:count], torch.ones(count))
    assert float(normal.norm()) == pytest.approx(1, abs=1e-5)


def test_a_jump_leaves_the_shadow_on_the_ground() -> None:
    normal = torch.tensor([0.0, -1.0, 0.0])
    found = along_plane(torch.tensor([[0.0, 0.0, 0.0], [1.0, -2.0, 0.5]]), normal)
    assert torch.allclose(found, torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]))


def test_points_of_the_ground_stay_right_before_it() -> None:
    found, gone = on_ground(points(), CAMERA, ground_depth())
    assert not gone.any()
    assert torch.allclose(found, IN_FRONT * points(), rtol=1e-5)


def test_a_point_below_the_ground_comes_up_to_it() -> None:
    lower = 1.08 * points()
    found, gone = on_ground(lower, CAMERA, ground_depth())
    assert not gone.any()
    assert torch.allclose(found, IN_FRONT * points(), rtol=1e-4)


def test_what_stands_before_a_point_hides_it() -> None:
    found, gone = on_ground(points(), CAMERA, 0.5 * ground_depth())
    assert not gone.any()
    assert torch.allclose(found, IN_FRONT * points())


def test_beyond_an_edge_there_is_nothing_to_darken() -> None:
    assert on_ground(points(), CAMERA, 2 * ground_depth())[1].all()


def test_points_outside_of_the_image_and_behind_the_camera() -> None:
    strange = torch.tensor([[100.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])
    found, gone = on_ground(strange, CAMERA, ground_depth())
    assert bool(found.isfinite().all())
    assert gone.tolist() == [False, True, True]

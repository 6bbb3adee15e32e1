"""Rigid motions, cameras, rays and depth in float64, against formulas written out by hand."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.autograd import gradcheck

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry import depth, quaternion, rays, rigid
from diff4splat.geometry.camera import (
    Camera,
    focal_from_35mm,
    focal_from_fov,
    pinhole,
    project,
)

F64 = torch.float64


def random_pose(*batch: int) -> torch.Tensor:
    rotation = quaternion.to_matrix(torch.randn(*batch, 4, dtype=F64))
    return rigid.from_parts(rotation, torch.randn(*batch, 3, dtype=F64))


def random_camera() -> Camera:
    return Camera(
        focal_px=torch.tensor([9.0, 11.0], dtype=F64),
        center_px=torch.tensor([4.2, 2.7], dtype=F64),
        world_from_camera=random_pose(),
        size_px=(6, 8),
    )


def test_inverse_undoes_a_motion() -> None:
    pose = random_pose(3)
    torch.testing.assert_close(pose @ rigid.invert(pose), torch.eye(4, dtype=F64).expand(3, 4, 4))


def test_look_at_puts_the_target_in_the_centre_and_down_below() -> None:
    position, target = torch.tensor([1.0, 2, 3], dtype=F64), torch.tensor([4.0, 1, 9], dtype=F64)
    down = torch.tensor([0.0, 1, 0], dtype=F64)
    pose = rigid.look_at(position, target, down)
    camera = replace(random_camera(), world_from_camera=pose)
    pixels, z = project(camera, torch.stack([target, target + 0.1 * down]))
    torch.testing.assert_close(pixels[0], camera.center_px)
    assert float(z[0]) == pytest.approx(float((target - position).norm()))
    assert pixels[1, 1] > pixels[0, 1]
    rigid.require_rigid(pose, "look_at")


def test_unproject_is_the_inverse_of_project() -> None:
    camera = random_camera()
    depths = torch.rand(6, 8, dtype=F64) + 0.5
    pixels, z = project(camera, depth.unproject(camera, depths).reshape(-1, 3))
    torch.testing.assert_close(z.reshape(6, 8), depths)
    torch.testing.assert_close(pixels.reshape(6, 8, 2), rays.pixel_centers((6, 8), pixels))


def test_plucker_map_depends_on_the_ray_and_not_on_the_point_on_it() -> None:
    camera = random_camera()
    moment, direction = rays.plucker_map(camera).movedim(0, -1).split(3, -1)
    on_ray = depth.unproject(camera, torch.full((6, 8), 3.7, dtype=F64))
    torch.testing.assert_close(torch.linalg.cross(on_ray, direction), moment)


def test_a_turn_on_the_spot_has_no_moment_and_scaling_moves_only_the_moment() -> None:
    poses = random_pose(2)
    poses[:, :3, 3] = 0
    camera = pinhole(9.0, (6, 8), F64).with_pose(poses)
    assert float(rays.plucker_map(camera)[:, :3].abs().max()) == 0
    moved, farther = random_pose(1).repeat(2, 1, 1)
    farther[:3, 3] *= 5
    near, far = (rays.plucker_map(pinhole(9.0, (6, 8), F64).with_pose(p)) for p in (moved, farther))
    torch.testing.assert_close(far[3:], near[3:])
    torch.testing.assert_close(far[:3], 5 * near[:3])


def test_a_change_of_world_leaves_the_relative_path_alone() -> None:
    camera = pinhole(9.0, (6, 8), F64).with_pose(random_pose(4))
    moved = camera.with_pose(random_pose() @ camera.world_from_camera)
    torch.testing.assert_close(
        rays.plucker_map(rays.relative_to_first(moved)),
        rays.plucker_map(rays.relative_to_first(camera)),
    )
    torch.testing.assert_close(
        rays.relative_to_first(camera).world_from_camera[0], torch.eye(4, dtype=F64)
    )


def test_gradients_agree_with_finite_differences() -> None:
    camera = random_camera()
    points = (
        torch.randn(4, 3, dtype=F64) * 0.1 + camera.world_from_camera[:3, 2] * 5 + camera.position
    ).requires_grad_()
    pose = camera.world_from_camera.clone().requires_grad_()

    def through(pose: torch.Tensor, points: torch.Tensor, focal: torch.Tensor) -> torch.Tensor:
        moved = replace(camera, world_from_camera=pose, focal_px=focal)
        return torch.cat([project(moved, points)[0].flatten(), rays.plucker_map(moved).flatten()])

    assert gradcheck(through, (pose, points, camera.focal_px.clone().requires_grad_()))
    depths = torch.rand(6, 8, dtype=F64, requires_grad=True)
    assert gradcheck(
        lambda d: depth.unproject(camera, depth.depth_from_distance(camera, d)), depths
    )


def test_resize_and_crop_keep_what_a_pixel_sees() -> None:
    camera = pinhole(9.0, (6, 8), F64)
    corner = rays.camera_rays(camera)[2, 3]
    cropped = camera.cropped((2, 3), (4, 5))
    torch.testing.assert_close(rays.camera_rays(cropped)[0, 0], corner)
    doubled = rays.camera_rays(camera.resized((12, 16)))
    torch.testing.assert_close(doubled[4:6, 6:8].mean((0, 1)), corner)


@given(st.floats(1.0, 178.0))
@settings(max_examples=25, deadline=None)
def test_a_focal_length_has_the_field_of_view_that_it_was_made_from(fov_deg: float) -> None:
    focal_px = focal_from_fov(fov_deg, 640)
    assert math.degrees(2 * math.atan(320 / focal_px)) == pytest.approx(fov_deg)


def test_35mm_equivalent_uses_the_diagonal() -> None:
    assert focal_from_35mm(math.hypot(36, 24), (300, 400)) == pytest.approx(500)


@pytest.mark.parametrize("focal_px", [1e-3, 1e6])
@pytest.mark.parametrize("far", [0.0, 1e6])
def test_extreme_cameras_stay_finite(focal_px: float, far: float) -> None:
    pose = torch.eye(4)
    pose[:3, 3] = far
    camera = pinhole(focal_px, (3, 5)).with_pose(pose)
    focal = camera.focal_px.clone().requires_grad_()
    plucker = rays.plucker_map(replace(camera, focal_px=focal))
    assert torch.isfinite(plucker).all()
    plucker.sum().backward()
    assert torch.isfinite(focal.grad).all()
    assert torch.isfinite(project(camera, camera.position[None])[0]).all()


def test_mirrored_scaled_and_unfinished_poses_are_refused() -> None:
    mirrored = torch.diag(torch.tensor([1.0, 1, -1, 1]))
    with pytest.raises(InputError, match="right-handed"):
        rigid.require_rigid(mirrored, "poses")
    with pytest.raises(InputError, match="without scale"):
        rigid.require_rigid(torch.diag(torch.tensor([2.0, 2, 2, 1])), "poses")
    with pytest.raises(InputError, match="finite"):
        rigid.require_rigid(torch.full((4, 4), torch.nan), "poses")


def test_nearest_rotation_removes_rounding() -> None:
    pose = random_pose()[:3, :3]
    rounded = (pose * 1e4).round() / 1e4
    cleaned = rigid.nearest_rotation(rounded)
    torch.testing.assert_close(cleaned @ cleaned.mT, torch.eye(3, dtype=F64))
    torch.testing.assert_close(cleaned, pose, atol=2e-4, rtol=0)


@pytest.mark.usefixtures("as_shipped")
def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ShapeError, match=r"Camera.focal_px: expected \(2, 2\), got \(2,\)"):
        Camera(
            focal_px=torch.ones(2),
            center_px=torch.ones(2, 2),
            world_from_camera=torch.eye(4).expand(2, 4, 4),
            size_px=(4, 4),
        )
    with pytest.raises(ShapeError, match="size_px"):
        pinhole(1.0, (0, 4))

"""Planes seen by other cameras, against rays cast one by one in float64."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.evaluation.systems.homography import plane_depth, plane_homography, warp_plane
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import Camera, pinhole

F64 = torch.float64


def camera(axis: tuple[float, float, float], angle: float, position: tuple[float, ...]) -> Camera:
    quat = quaternion.from_axis_angle(torch.tensor(axis, dtype=F64), torch.tensor(angle, dtype=F64))
    pose = rigid.from_parts(quaternion.to_matrix(quat), torch.tensor(position, dtype=F64))
    return pinhole(30.0, (12, 16), F64).with_pose(pose)


def cast(source: Camera, target: Camera, depth: float, x: float, y: float) -> tuple[float, ...]:
    """Where the target's pixel (x, y) meets the plane: source pixel and target z."""
    focal, center = target.focal_px.numpy(), target.center_px.numpy()
    ray = np.array([(x - center[0]) / focal[0], (y - center[1]) / focal[1], 1.0])
    to_world, from_world = (
        target.world_from_camera.numpy(),
        np.linalg.inv(source.world_from_camera.numpy()),
    )
    pose = from_world @ to_world
    direction, origin = pose[:3, :3] @ ray, pose[:3, 3]
    z = (depth - origin[2]) / direction[2]
    hit = origin + z * direction
    focal, center = source.focal_px.numpy(), source.center_px.numpy()
    return (*(hit[:2] / hit[2] * focal + center), z)


@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(-0.6, 0.6),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.floats(2, 20),
)
@settings(max_examples=25, deadline=None)
def test_pixels_go_where_their_rays_meet_the_plane(
    axis: tuple[float, float, float], angle: float, position: tuple[float, ...], depth: float
) -> None:
    source, target = camera((0, 1, 0), 0.2, (0.3, 0, 0)), camera(axis, angle, position)
    matrix = plane_homography(source, target, depth).numpy()
    z = plane_depth(source, target, depth)
    for x, y in ((0.5, 0.5), (3.5, 10.5), (15.5, 11.5)):
        want = cast(source, target, depth, x, y)
        if want[2] <= 0:
            assert float(z[int(y), int(x)]) == 0
            continue
        got = matrix @ np.array([x, y, 1.0])
        assert np.allclose(got[:2] / got[2], want[:2], atol=1e-6 * max(1, *map(abs, want)))
        assert float(z[int(y), int(x)]) == pytest.approx(want[2], rel=1e-5)


def test_the_camera_itself_sees_the_image() -> None:
    rgb = torch.rand(12, 16, 3)
    own = camera((0, 1, 0), 0.2, (0.3, 0, 0))
    assert torch.allclose(warp_plane(rgb, own, own, 5.0), rgb, atol=1e-5)
    assert torch.allclose(plane_depth(own, own, 5.0), torch.full((12, 16), 5.0))


def test_a_step_to_the_right_shifts_the_image_to_the_left() -> None:
    rgb = torch.rand(12, 16, 3)
    here = pinhole(30.0, (12, 16), F64)
    # Two pixels: 30 px · 0.4 / 6.
    there = here.with_pose(
        rigid.from_parts(torch.eye(3, dtype=F64), torch.tensor([0.4, 0, 0.0]).double())
    )
    seen = warp_plane(rgb, here, there, 6.0)
    assert torch.allclose(seen[:, :-2], rgb[:, 2:], atol=1e-5)
    assert torch.allclose(seen[:, -1], rgb[:, -1], atol=1e-5), "borders continue"


def test_rays_that_miss_the_plane_stay_finite() -> None:
    rgb = torch.rand(12, 16, 3)
    here = pinhole(30.0, (12, 16), F64)
    behind = camera((0, 1, 0), 3.1, (0, 0, 0))
    sideways = camera((0, 1, 0), float(np.pi / 2), (0, 0, 5.0))
    for other in (behind, sideways):
        assert bool(torch.isfinite(warp_plane(rgb, here, other, 5.0)).all())
        assert bool(torch.isfinite(plane_depth(here, other, 5.0)).all())
    assert not bool(plane_depth(here, behind, 5.0).any())

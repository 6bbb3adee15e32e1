import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.spline import interpolate_keyframes, resample

SEEDS = st.integers(0, 10_000)


def _straight(times: list[float]) -> CameraPath:
    times_s = torch.tensor(times, dtype=torch.float64)
    poses = torch.eye(4, dtype=torch.float64).repeat(len(times), 1, 1)
    poses[:, :3, 3] = torch.tensor([1.0, -2.0, 3.0], dtype=torch.float64) * times_s[:, None]
    return CameraPath(
        cameras=pinhole(50.0, (8, 8), torch.float64).with_pose(poses), times_s=times_s
    )


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 12))
def test_keys_are_passed(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count)
    found = interpolate_keyframes(path, path.times_s)
    assert torch.equal(found.cameras.position, path.cameras.position)
    poses = (found.cameras.world_from_camera, path.cameras.world_from_camera)
    torch.testing.assert_close(*poses, atol=1e-14, rtol=0)
    torch.testing.assert_close(found.cameras.focal_px, path.cameras.focal_px)
    torch.testing.assert_close(found.cameras.center_px, path.cameras.center_px)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(2, 12), st.floats(0, 1))
def test_positions_match_a_dense_natural_spline(seed: int, count: int, share: float) -> None:
    path = oracles_paths.random_path(seed, count)
    time_s = share * float(path.times_s[-1])
    found = interpolate_keyframes(path, torch.tensor([time_s], dtype=torch.float64))
    keys = path.times_s.numpy(), path.cameras.position.numpy()
    expected = oracles_paths.natural_spline(*keys, time_s)
    np.testing.assert_allclose(found.cameras.position[0].numpy(), expected, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize("times", [[0.0, 1.0], [0.0, 0.01, 5.0, 5.001, 90.0], [0.0, 1e-6, 1e3]])
def test_straight_uniform_motion_stays_exact(times: list[float]) -> None:
    path = _straight(times)
    asked = torch.linspace(0, times[-1], 57, dtype=torch.float64)
    position = interpolate_keyframes(path, asked).cameras.position
    expected = asked[:, None] * torch.tensor([1.0, -2.0, 3.0], dtype=torch.float64)
    torch.testing.assert_close(position, expected, rtol=1e-12, atol=1e-12)


def test_velocity_and_acceleration_do_not_jump_at_a_key() -> None:
    path = oracles_paths.random_path(3, 6)
    key, step = path.times_s[2], 1e-4
    around = key + step * torch.arange(-3, 4, dtype=torch.float64)
    position = interpolate_keyframes(path, around).cameras.position
    second = position.diff(n=2, dim=0) / step**2
    # A jump of the acceleration would show as a step of its own size between the two sides.
    torch.testing.assert_close(second[0], second[-1], rtol=1e-2, atol=1.0)
    assert float(second.norm(dim=-1).max()) > 20


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_rotation_speed_is_constant_between_keys(seed: int) -> None:
    path = oracles_paths.random_path(seed, 3)
    asked = torch.linspace(float(path.times_s[1]), float(path.times_s[2]), 9, dtype=torch.float64)
    rotation = interpolate_keyframes(path, asked).cameras.world_from_camera[:, :3, :3]
    turns = [oracles_paths.angle_deg(a, b) for a, b in pairwise(rotation)]
    whole = oracles_paths.angle_deg(rotation[0], rotation[-1])
    assert turns == pytest.approx([whole / 8] * 8, rel=1e-6)


def test_focal_length_changes_by_equal_factors() -> None:
    cameras = replace(
        pinhole(50.0, (8, 8), torch.float64).with_pose(
            torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
        ),
        focal_px=torch.tensor([[10.0, 20.0], [1000.0, 20.0]], dtype=torch.float64),
    )
    path = CameraPath(cameras=cameras, times_s=torch.tensor([0.0, 2.0], dtype=torch.float64))
    halfway = interpolate_keyframes(path, torch.tensor([1.0], dtype=torch.float64))
    assert halfway.cameras.focal_px[0].tolist() == pytest.approx([100.0, 20.0])


def test_outside_the_keys_the_ends_hold() -> None:
    path = oracles_paths.random_path(1, 4)
    asked = torch.tensor([-1e9, -0.1, 1e3, 1e9], dtype=torch.float64)
    found = interpolate_keyframes(path, asked)
    ends = path.cameras.world_from_camera[[0, 0, -1, -1]]
    torch.testing.assert_close(found.cameras.world_from_camera, ends, atol=1e-14, rtol=0)
    assert torch.equal(found.times_s, asked)


def test_one_key_holds_everywhere() -> None:
    path = oracles_paths.random_path(1, 1)
    found = interpolate_keyframes(path, torch.tensor([-1.0, 0.0, 7.0], dtype=torch.float64))
    assert torch.equal(found.cameras.position, path.cameras.position.expand(3, 3))


def test_no_times_give_no_cameras() -> None:
    assert len(interpolate_keyframes(oracles_paths.random_path(1, 4), torch.zeros(0).double())) == 0


def test_half_turns_between_keys_stay_finite() -> None:
    path = oracles_paths.random_path(1, 2)
    poses = path.cameras.world_from_camera.clone()
    poses[1, :3, :3] = torch.diag(torch.tensor([-1.0, 1.0, -1.0], dtype=torch.float64))
    path = replace(path, cameras=path.cameras.with_pose(poses))
    found = interpolate_keyframes(path, path.times_s[-1:] / 2)
    turned = oracles_paths.angle_deg(found.cameras.world_from_camera[0, :3, :3], torch.eye(3))
    assert turned == pytest.approx(90)


def test_many_keys_are_quick_and_finite() -> None:
    times_s = torch.arange(20_000, dtype=torch.float64) / 24
    poses = torch.eye(4, dtype=torch.float64).repeat(20_000, 1, 1)
    poses[:, 0, 3] = torch.sin(times_s)
    path = CameraPath(cameras=pinhole(9.0, (8, 8), torch.float64).with_pose(poses), times_s=times_s)
    asked = times_s[:-1] + 1 / 48
    found = interpolate_keyframes(path, asked).cameras.position[10:-10, 0]
    torch.testing.assert_close(found, torch.sin(asked)[10:-10], atol=1e-7, rtol=0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_times_to_interpolate_at_must_be_finite(bad: float) -> None:
    with pytest.raises(InputError, match="expected finite times to interpolate at"):
        interpolate_keyframes(oracles_paths.random_path(1, 4), torch.tensor([0.0, bad]))


def test_unusable_keys_are_refused() -> None:
    path = oracles_paths.random_path(1, 4)
    with pytest.raises(InputError, match="key frames: expected finite times that increase"):
        interpolate_keyframes(replace(path, times_s=path.times_s.flip(0)), path.times_s)


def test_gradients_reach_positions_times_and_lenses() -> None:
    path = oracles_paths.random_path(4, 5)

    def cameras_at(
        position: torch.Tensor, focal_px: torch.Tensor, asked: torch.Tensor
    ) -> torch.Tensor:
        pose = path.cameras.world_from_camera.clone()
        pose[:, :3, 3] = position
        cameras: Camera = replace(path.cameras, world_from_camera=pose, focal_px=focal_px)
        found = interpolate_keyframes(replace(path, cameras=cameras), asked).cameras
        return torch.cat([found.world_from_camera.flatten(), found.focal_px.flatten()])

    inputs = (
        path.cameras.position.clone().requires_grad_(),
        path.cameras.focal_px.clone().requires_grad_(),
        (path.times_s[:-1] + 0.3 * path.times_s.diff()).requires_grad_(),
    )
    assert torch.autograd.gradcheck(cameras_at, inputs)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 8), st.integers(1, 40))
def test_resampling_keeps_the_ends_and_sets_the_clock(seed: int, keys: int, frames: int) -> None:
    path = oracles_paths.random_path(seed, keys)
    film = resample(path, frames, 10.0)
    assert len(film) == frames
    torch.testing.assert_close(film.times_s, torch.arange(frames, dtype=torch.float64) / 10)
    assert torch.equal(film.cameras.position[0], path.cameras.position[0])
    if frames > 1:
        torch.testing.assert_close(film.cameras.position[-1], path.cameras.position[-1])


def test_resampling_ignores_where_the_clock_starts() -> None:
    path = oracles_paths.random_path(2, 5)
    late = replace(path, times_s=path.times_s + 1000)
    early_film, late_film = resample(path, 9, 10.0), resample(late, 9, 10.0)
    torch.testing.assert_close(late_film.times_s, early_film.times_s)
    positions = late_film.cameras.position, early_film.cameras.position
    torch.testing.assert_close(*positions, atol=1e-8, rtol=0)


def test_resampling_keeps_float32() -> None:
    path = oracles_paths.random_path(2, 5)
    path = CameraPath(cameras=path.cameras.to(torch.float32), times_s=path.times_s.float())
    film = resample(path, 9, 10.0)
    assert film.cameras.focal_px.dtype == film.times_s.dtype == torch.float32


@pytest.mark.parametrize(("frames", "fps"), [(0, 24.0), (5, 0.0), (5, math.nan)])
def test_resampling_needs_frames_and_a_rate(frames: int, fps: float) -> None:
    with pytest.raises(InputError, match=r"frames: expected|fps: expected"):
        resample(oracles_paths.random_path(2, 5), frames, fps)


def test_slerp_takes_the_shorter_way_between_keys() -> None:
    path = oracles_paths.random_path(1, 2)
    poses = path.cameras.world_from_camera.clone()
    angle = torch.tensor(math.radians(350), dtype=torch.float64)
    axis = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    poses[1, :3, :3] = quaternion.to_matrix(quaternion.from_axis_angle(axis, angle))
    path = replace(path, cameras=path.cameras.with_pose(poses))
    found = interpolate_keyframes(path, path.times_s[-1:] / 2).cameras.world_from_camera[0, :3, :3]
    assert oracles_paths.angle_deg(found, torch.eye(3)) == pytest.approx(5)

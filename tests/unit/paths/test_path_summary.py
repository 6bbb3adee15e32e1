import math
from dataclasses import replace

import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.presets import PRESETS
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.paths.summary import summarize

VIEW = PathFrame(camera=pinhole(60.0, (48, 64)), near_depth=2.0, focus_depth=5.0)


def _built(text: str, frames: int = 41) -> CameraPath:
    return build_path(text, VIEW, PathSettings(frames=frames, fps=20.0))


def _on_a_line(positions: list[float]) -> CameraPath:
    poses = torch.eye(4, dtype=torch.float64).repeat(len(positions), 1, 1)
    poses[:, 0, 3] = torch.tensor(positions, dtype=torch.float64)
    cameras = pinhole(50.0, (8, 8), torch.float64).with_pose(poses)
    return CameraPath(cameras=cameras, times_s=torch.arange(len(positions), dtype=torch.float64))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 9))
def test_numbers_agree_with_their_definitions(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count)
    found = summarize(path)
    poses = path.cameras.world_from_camera
    turns = [
        oracles_paths.angle_deg(poses[i, :3, :3], poses[i + 1, :3, :3]) for i in range(count - 1)
    ]
    steps = [math.dist(poses[i, :3, 3], poses[i + 1, :3, 3]) for i in range(count - 1)]
    assert found.frames == count
    assert found.seconds == pytest.approx(float(path.times_s[-1]))
    assert found.travel == pytest.approx(sum(steps))
    assert found.largest_step == pytest.approx(max(steps))
    assert found.farthest == pytest.approx(float(poses[:, :3, 3].norm(dim=-1).max()))
    assert found.turn_deg == pytest.approx(sum(turns), rel=1e-6)
    assert found.largest_turn_deg == pytest.approx(max(turns), rel=1e-6)
    lens = path.cameras.focal_px
    assert found.focal_range_px == (float(lens.min()), float(lens.max()))


def test_an_orbit_in_words() -> None:
    found = summarize(_built("orbit:1", 361), near_depth=2.0)
    assert found.seconds == pytest.approx(18)
    assert found.travel == pytest.approx(2 * math.pi * 5, rel=1e-3)
    assert found.farthest == pytest.approx(10)
    assert found.turn_deg == pytest.approx(360, rel=1e-4)
    assert found.warnings == (
        "the camera goes 5.0 near depths away from where it starts; "
        "expect to see places that the image does not show",
    )


@pytest.mark.parametrize("name", sorted(set(PRESETS) - {"orbit"}))
def test_presets_at_their_defaults_warn_of_nothing(name: str) -> None:
    for frames in (1, 2, 6, 7, 9, 41):
        assert summarize(_built(name, frames), near_depth=2.0).warnings == ()


def test_one_frame() -> None:
    found = summarize(_built("spiral", 1), near_depth=1.0)
    assert (found.travel, found.largest_step, found.turn_deg, found.largest_turn_deg) == (
        0,
        0,
        0,
        0,
    )
    assert found.seconds == 0


def test_a_sharp_turn_is_named_with_its_frame() -> None:
    path = _on_a_line([0.0] * 5)
    poses = path.cameras.world_from_camera.clone()
    poses[3:, :3, :3] = torch.diag(torch.tensor([-1.0, 1.0, -1.0], dtype=torch.float64))
    found = summarize(replace(path, cameras=path.cameras.with_pose(poses)))
    assert found.largest_turn_deg == pytest.approx(180)
    assert found.warnings[0].startswith("frame 3: the camera turns 180 degrees in one step")


def test_a_cut_is_named_with_its_frame() -> None:
    found = summarize(_on_a_line([0.0, 0.1, 0.2, 5.0, 5.1, 5.2]))
    assert [warning[:25] for warning in found.warnings] == ["frame 3: the camera jumps"]


def test_a_cut_out_of_standstill_is_a_cut_too() -> None:
    assert len(summarize(_on_a_line([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])).warnings) == 1


def test_small_turns_keep_their_digits() -> None:
    path = _on_a_line([0.0, 1.0])
    poses, angle = path.cameras.world_from_camera.clone(), 1e-9
    poses[1, 0, 2], poses[1, 2, 0] = angle, -angle
    found = summarize(replace(path, cameras=path.cameras.with_pose(poses)))
    assert found.turn_deg == pytest.approx(math.degrees(1e-9), rel=1e-6)


def test_unusable_paths_are_refused() -> None:
    with pytest.raises(InputError, match="expected at least one camera pose"):
        summarize(CameraPath(cameras=_on_a_line([0.0]).cameras[:0], times_s=torch.zeros(0)))

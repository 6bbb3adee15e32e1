from dataclasses import replace

import oracles_paths
import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.paths.camera_path import CameraPath, require_valid_path


def test_a_usable_path_comes_back_as_it_is() -> None:
    path = oracles_paths.random_path(0, 4)
    assert require_valid_path(path, "path") is path
    assert len(path) == 4


def test_cameras_and_times_must_agree(as_shipped: None) -> None:
    path = oracles_paths.random_path(0, 4)
    with pytest.raises(ShapeError, match=r"CameraPath.times_s: expected \(4,\), got \(3,\)"):
        CameraPath(cameras=path.cameras, times_s=path.times_s[:3])


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([0.0, 0.1, 0.1], "increase from frame to frame"),
        ([0.0, 0.2, 0.1], "increase from frame to frame"),
        ([0.0, float("nan"), 1.0], "increase from frame to frame"),
        ([0.0, 1.0, float("inf")], "finite times"),
    ],
)
def test_times_must_increase(times: list[float], words: str) -> None:
    path = oracles_paths.random_path(0, 3)
    with pytest.raises(InputError, match=words):
        require_valid_path(replace(path, times_s=torch.tensor(times)), "path")


def test_no_poses_are_refused() -> None:
    path = oracles_paths.random_path(0, 3)
    empty = CameraPath(cameras=path.cameras[:0], times_s=path.times_s[:0])
    with pytest.raises(InputError, match=r"path.txt: expected at least one camera pose, got none"):
        require_valid_path(empty, "path.txt")


@pytest.mark.parametrize("focal_px", [0.0, -1.0, float("nan"), float("inf")])
def test_intrinsics_must_be_finite_and_positive(focal_px: float) -> None:
    path = oracles_paths.random_path(0, 3)
    broken = replace(path.cameras, focal_px=torch.full_like(path.cameras.focal_px, focal_px))
    with pytest.raises(InputError, match="expected finite intrinsics and focal lengths above 0"):
        require_valid_path(replace(path, cameras=broken), "path")


@pytest.mark.parametrize(
    ("corner", "words"), [(-1.0, "determinant"), (1.01, "scale or shear"), (float("nan"), "finite")]
)
def test_poses_must_be_rigid(corner: float, words: str) -> None:
    path = oracles_paths.random_path(0, 3)
    poses = path.cameras.world_from_camera.clone()
    poses[0, 0, 0] = corner
    with pytest.raises(InputError, match=words):
        require_valid_path(replace(path, cameras=path.cameras.with_pose(poses)), "path")

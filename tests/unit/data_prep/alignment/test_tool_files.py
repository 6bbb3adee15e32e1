"""Files as Video Depth Anything and MegaSaM write them, whole and damaged."""

import numpy as np
import OpenEXR
import pytest

from diff4splat.data_prep.alignment.tool_files.megasam import (
    find_megasam,
    moving_pixels,
    normaliser,
    read_megasam,
    read_motion_probability,
)
from diff4splat.data_prep.alignment.tool_files.video_depth_anything import (
    find_disparity,
    read_disparity,
)
from diff4splat.errors import FileFormatError, InputError


def test_frames_of_exr_are_in_the_order_of_their_numbers(tmp_path) -> None:
    folder = tmp_path / "clip"
    folder.mkdir()
    for number in (0, 2, 10):
        channels = {"Z": np.full((2, 3), number, np.float32)}
        OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(
            str(folder / f"f_{number}.exr")
        )
    found = read_disparity(find_disparity(tmp_path, "clip"))
    assert found[:, 0, 0].tolist() == [0, 2, 10]


def test_infinite_and_negative_disparity_is_infinitely_far(tmp_path) -> None:
    values = np.array([[[1.0, np.nan, np.inf, -1.0]]], np.float16)
    np.savez(tmp_path / "x_depths.npz", depths=values)
    assert read_disparity(find_disparity(tmp_path, "x")).tolist() == [[[1, 0, 0, 0]]]


def test_arrays_of_objects_are_never_loaded(tmp_path) -> None:
    np.savez(tmp_path / "x.npz", depths=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileFormatError, match="would run code"):
        read_disparity(tmp_path / "x.npz")


def test_a_file_that_is_not_there_says_what_to_run(tmp_path) -> None:
    with pytest.raises(FileFormatError, match="run Video Depth Anything"):
        find_disparity(tmp_path, "x")
    (tmp_path / "x_droid.npz").write_bytes(b"")
    with pytest.raises(FileFormatError, match="run its cvd_opt step"):
        find_megasam(tmp_path, "x")


def write_megasam(file, turn: float = 1.0) -> None:
    poses = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    poses[:, 0, 0] = turn
    depth = np.array([[[1e-3, 2.0, 100.0]], [[4.0, 5.0, 6.0]]], np.float16)
    np.savez(file, depths=depth, cam_c2w=poses, intrinsic=np.eye(3), images=np.zeros((2, 1, 3, 3)))


def test_clipped_depth_of_megasam_is_unknown(tmp_path) -> None:
    write_megasam(tmp_path / "x_sgd_cvd_hr.npz")
    scene = read_megasam(find_megasam(tmp_path, "x"))
    assert scene.depth[:, 0].tolist() == [[0, 2, 0], [4, 5, 6]]


def test_left_handed_poses_are_refused(tmp_path) -> None:
    write_megasam(tmp_path / "x.npz", turn=-1.0)
    with pytest.raises(FileFormatError, match="cam_c2w"):
        read_megasam(tmp_path / "x.npz")


def test_the_normaliser_follows_its_formula() -> None:
    rng = np.random.default_rng(0)
    disparity = rng.uniform(0, 1, (5, 20, 30))
    metric = 1 / (0.4 * disparity + 0.05)
    expected = np.percentile(0.4 * disparity + 0.05, 98) / 2
    assert normaliser(disparity, metric) == pytest.approx(expected)
    with pytest.raises(InputError, match="of one shape"):
        normaliser(disparity, metric[:2])
    with pytest.raises(InputError, match="one value in a frame"):
        normaliser(np.ones((1, 4, 4)), np.ones((1, 4, 4)))


def test_motion_probability_is_low_where_it_moves(tmp_path) -> None:
    probability = np.full((2, 4, 6), 0.9, np.float32)
    probability[:, 0, 0] = 0.1
    np.save(tmp_path / "motion_prob.npy", probability)
    moving = moving_pixels(read_motion_probability(tmp_path / "motion_prob.npy"), (32, 48))
    assert moving[:, :8, :8].all()
    assert moving.mean() == pytest.approx(1 / 24)
    assert moving_pixels(np.full((1, 4, 4), 0.5, np.float32), (8, 8)) is None
    assert moving_pixels(np.eye(4, dtype=np.float32)[None], (8, 8)) is None

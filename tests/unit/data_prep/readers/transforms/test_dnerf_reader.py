"""D-NeRF folders: axes, times, white behind the scene, the given split, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from capture_checks import assert_pose, assert_sees
from capture_folders import change_json, dnerf_cameras, seer, write_dnerf, write_image, write_json

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import ConfigError, FileFormatError, InputError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_dnerf(tmp_path / "bouncing")


def test_the_point_lies_in_its_pixel_and_all_that_is_known_is_read(folder: Path) -> None:
    assert detect_format(folder) == "dnerf"
    capture = read_capture(folder)
    cameras = dnerf_cameras("train") + dnerf_cameras("test")
    assert capture.times_s.tolist() == [time for _, time in cameras]
    assert capture.held_out.tolist() == [False] * 6 + [True] * 3
    for index, (camera, time) in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_sees(capture, index, camera, time)
    assert (capture.name, capture.source) == ("bouncing", "D-NeRF")
    assert str(report_split(capture)) == "6 frames to learn from, 3 held out (new views)"
    assert "transforms_test.json" in capture.split_reason
    assert any("transforms_val.json was left out" in note for note in capture.notes)


def test_transparency_lies_over_white_or_what_was_asked_for(folder: Path) -> None:
    capture = read_capture(folder)
    assert capture.background == (1, 1, 1)
    assert capture.frames.read(0).rgb[0, 0].tolist() == [1, 1, 1]
    capture = read_capture(folder, ReadOptions(background=(0.0, 0.5, 0.0)))
    assert capture.background == (0, 0.5, 0)
    assert capture.frames.read(0).rgb[0, 0].tolist() == [0, 0.5, 0]
    assert capture.frames.read(0).counts is None


def test_half_transparent_pixels_are_mixed(folder: Path) -> None:
    rgba = np.full((24, 36, 4), 102, np.uint8)
    write_image(folder / "train" / "r_000.png", rgba)
    level = float(read_capture(folder).frames.read(0).rgb[5, 5, 1])
    assert level == pytest.approx(0.4 * 0.4 + 0.6)


def test_images_without_transparency_have_no_known_background(tmp_path: Path) -> None:
    assert read_capture(write_dnerf(tmp_path, alpha=False)).background is None


def test_val_can_be_held_out_in_place_of_test(folder: Path) -> None:
    capture = read_capture(folder, ReadOptions(hold_out=(1,)))
    assert len(capture) == 8
    assert report_split(capture).new_views == 2
    assert "transforms_val.json" in capture.split_reason
    assert len(read_capture(folder, ReadOptions(hold_out=(2, 1)))) == 11
    assert report_split(read_capture(folder, ReadOptions(hold_out=()))).held_out == 0
    with pytest.raises(ConfigError, match=r"hold_out: expected 1 \(val\) or 2 \(test\), got \[0\]"):
        read_capture(folder, ReadOptions(hold_out=(0,)))


def test_without_test_images_val_or_else_every_eighth_time_is_held_out(tmp_path: Path) -> None:
    with_val = read_capture(write_dnerf(tmp_path / "a", ("train", "val")))
    assert "transforms_val.json" in with_val.split_reason
    alone = write_dnerf(tmp_path / "b", ("train",))
    capture = read_capture(alone)
    assert capture.held_out.tolist() == [True] + [False] * 5
    assert "every 8th time" in capture.split_reason
    with pytest.raises(ConfigError, match=r"expected transforms_test\.json, got no such file"):
        read_capture(alone, ReadOptions(hold_out=(2,)))


def test_lego_comes_with_a_warning(tmp_path: Path) -> None:
    notes = read_capture(write_dnerf(tmp_path / "Lego")).notes
    assert any("lego" in note and "do not show" in note for note in notes)
    assert not any("lego" in note for note in read_capture(write_dnerf(tmp_path / "hook")).notes)


def test_a_file_of_the_folder_stands_for_the_folder(folder: Path) -> None:
    assert len(read_capture(folder / "transforms_train.json")) == 9


def test_a_time_that_is_missing_is_named(folder: Path) -> None:
    change_json(folder / "transforms_train.json", lambda root: root["frames"][3].pop("time"))
    with pytest.raises(FileFormatError, match="frame 3: expected 'time', got none; write the time"):
        read_capture(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda frame: frame["transform_matrix"][0].__setitem__(3, float("nan")),
            "frame 1: 'transform_matrix': expected a finite number, got nan",
        ),
        (
            lambda frame: [row.__setitem__(0, -row[0]) for row in frame["transform_matrix"]],
            "frame 1: expected a right-handed rotation .* got determinant -1",
        ),
        (
            lambda frame: frame.update(transform_matrix=frame["transform_matrix"][:3]),
            "expected 4 rows of 4 numbers, got 3 rows",
        ),
        (
            lambda frame: frame.update(file_path="../../secret"),
            r"frame 1: expected a path inside .*, got '\.\./\.\./secret'",
        ),
        (lambda frame: frame.update(file_path="/etc/passwd"), "expected a path inside"),
        (lambda frame: frame.update(file_path="train/r_999"), "r_999, got no such file"),
        (lambda frame: frame.update(file_path=7), "'file_path': expected the path of a file"),
        (lambda frame: frame.update(time="0.1"), "'time': expected a number, got the text"),
    ],
)
def test_frames_that_make_no_sense_are_refused(folder: Path, change, message: str) -> None:
    change_json(folder / "transforms_train.json", lambda root: change(root["frames"][1]))
    with pytest.raises(FileFormatError, match=message):
        read_capture(folder)


def test_files_that_make_no_sense_are_refused(folder: Path) -> None:
    file = folder / "transforms_train.json"
    change_json(file, lambda root: root.pop("camera_angle_x"))
    with pytest.raises(FileFormatError, match=r"expected a focal length \(fl_x"):
        read_capture(folder)
    file.write_text("{frames: }")
    with pytest.raises(FileFormatError, match=r"transforms_train\.json: line 1: expected JSON"):
        read_capture(folder)
    file.write_text("[]")
    with pytest.raises(FileFormatError, match="expected a JSON object, got a list of 0"):
        read_capture(folder)


def test_images_of_different_sizes_are_named(folder: Path) -> None:
    write_image(folder / "train" / "r_002.png", np.zeros((20, 36, 4), np.uint8))
    with pytest.raises(
        FileFormatError, match=r"r_002\.png: .*36 x 24, got 36 x 20: images of diff"
    ):
        read_capture(folder)


def test_two_images_of_one_time_are_of_two_cameras(folder: Path) -> None:
    change_json(
        folder / "transforms_train.json",
        lambda root: [frame.update(time=(i // 2) / 2) for i, frame in enumerate(root["frames"])],
    )
    assert read_capture(folder).camera_index.tolist() == [0, 1] * 3 + [2] * 3


def test_cameras_that_stand_are_told_by_their_poses(tmp_path: Path) -> None:
    frames = []
    for index in range(8):
        camera = seer(0.4 * (index % 2), focal_px=(30.0, 30.0), center_px=(18.0, 12.0))
        write_image(tmp_path / f"{index}.png", np.zeros((24, 36, 3), np.uint8))
        frames.append(
            {"file_path": str(index), "time": index // 2, "transform_matrix": camera.opengl()}
        )
    write_json(tmp_path / "transforms_train.json", {"camera_angle_x": 1.0, "frames": frames[::-1]})
    capture = read_capture(tmp_path)
    assert capture.camera_index.tolist() == [0, 1] * 4
    assert capture.times_s.tolist() == [3, 3, 2, 2, 1, 1, 0, 0]
    assert capture.held_out.tolist() == [False] * 6 + [True] * 2


def test_one_standing_camera_is_refused(tmp_path: Path) -> None:
    pose = seer(0.1).opengl()
    frames = []
    for index in range(4):
        write_image(tmp_path / f"{index}.png", np.zeros((24, 36, 3), np.uint8))
        frames.append({"file_path": str(index), "time": index / 3, "transform_matrix": pose})
    write_json(tmp_path / "transforms_train.json", {"camera_angle_x": 1.0, "frames": frames})
    with pytest.raises(InputError, match="images from at least two places, got one static"):
        read_capture(tmp_path)

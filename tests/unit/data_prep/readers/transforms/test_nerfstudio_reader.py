"""nerfstudio's transforms.json: times, points, lists of frames, lenses."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from capture_checks import assert_pose, assert_sees, middle_of_light, projected
from capture_folders import (
    blob_image,
    change_json,
    point_at,
    rig_cameras,
    side_point_at,
    write_image,
    write_json,
    write_transforms,
)

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import FileFormatError, InputError


def change_frames(folder: Path, change) -> None:
    change_json(folder / "transforms.json", lambda root: [change(f) for f in root["frames"]])


def test_the_point_lies_in_its_pixel_and_every_eighth_time_is_held_out(tmp_path: Path) -> None:
    cameras = write_transforms(tmp_path)
    assert detect_format(tmp_path) == "transforms"
    capture = read_capture(tmp_path)
    assert capture.times_s.tolist() == [index / 10 for index in range(16)]
    for index, camera in enumerate(cameras):
        assert_pose(capture, index, camera)
        assert_sees(capture, index, camera, index / 10)
    assert capture.held_out.nonzero().flatten().tolist() == [0, 8]
    assert report_split(capture).new_views == 2
    assert "every 8th time held out, by default" in capture.split_reason


def test_frames_out_of_order_keep_their_times(tmp_path: Path) -> None:
    cameras = write_transforms(tmp_path)
    change_json(tmp_path / "transforms.json", lambda root: root["frames"].reverse())
    capture = read_capture(tmp_path)
    assert capture.times_s.tolist() == [index / 10 for index in reversed(range(16))]
    assert_sees(capture, 0, cameras[15], 1.5)
    assert capture.held_out.nonzero().flatten().tolist() == [7, 15]


def test_a_rig_misses_a_whole_camera(tmp_path: Path) -> None:
    frames = []
    for time in range(4):
        for number, camera in enumerate(rig_cameras(3)):
            name = f"{number}/{time}.png"
            write_image(tmp_path / name, np.zeros((24, 36, 3), np.uint8))
            frame = {"file_path": name, "time": time / 4, "transform_matrix": camera.opengl()}
            frames.append(frame)
    write_json(tmp_path / "transforms.json", {"fl_x": 30, "frames": frames})
    capture = read_capture(tmp_path)
    assert capture.camera_index.tolist() == [0, 1, 2] * 4
    assert torch.equal(capture.held_out, capture.camera_index == 0)
    assert report_split(capture).kind == "new views"


def test_lists_of_frames_say_what_is_held_out(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    names = [f"images/frame_{index + 1:05d}.png" for index in range(16)]

    def with_lists(root: dict) -> None:
        root.update(train_filenames=names[:10], val_filenames=names[10:12])
        root.update(test_filenames=["./" + names[13]])

    change_json(tmp_path / "transforms.json", with_lists)
    capture = read_capture(tmp_path)
    assert (len(capture), int(capture.held_out.sum())) == (13, 3)
    assert capture.times_s[capture.held_out].tolist() == [1.0, 1.1, 1.3]
    assert capture.split_reason == "lists of frames in transforms.json"
    assert any("3 frames that are in no list" in note for note in capture.notes)
    change_json(tmp_path / "transforms.json", lambda root: root.update(val_filenames=["x.png"]))
    with pytest.raises(FileFormatError, match=r"'val_filenames': .* got 'x\.png', which no frame"):
        read_capture(tmp_path)


def test_one_list_alone_leaves_the_rest_to_the_other_side(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    names = [f"images/frame_{index + 1:05d}.png" for index in range(12)]
    change_json(tmp_path / "transforms.json", lambda root: root.update(train_filenames=names))
    assert int(read_capture(tmp_path).held_out.sum()) == 4


def test_missing_times_are_named_unless_a_rate_is_given(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    change_frames(tmp_path, lambda frame: frame.pop("time"))
    with pytest.raises(FileFormatError, match="frame 0: expected 'time', got none; add the sec"):
        read_capture(tmp_path)
    capture = read_capture(tmp_path, ReadOptions(fps=4.0))
    assert capture.times_s[:3].tolist() == [0, 0.25, 0.5]
    assert any("4 frames per second" in note for note in capture.notes)
    change_json(tmp_path / "transforms.json", lambda root: root["frames"][0].update(time=0.0))
    with pytest.raises(FileFormatError, match="frame 1: expected 'time', got none"):
        read_capture(tmp_path, ReadOptions(fps=4.0))


def test_two_images_of_one_place_and_time_are_two_cameras_in_vain(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    change_json(
        tmp_path / "transforms.json",
        lambda root: root["frames"][1].update(root["frames"][0], file_path="images/frame_00002"),
    )
    with pytest.raises(InputError, match="training does not see, got frame 1"):
        report_split(read_capture(tmp_path, ReadOptions(hold_out=(1,))))


def test_bent_images_are_straightened(tmp_path: Path) -> None:
    lens = {"radial": (-0.2, 0.1, 0.0), "tangential": (0.02, 0.01)}
    cameras = write_transforms(tmp_path, count=4, draw=blob_image, **lens)
    capture = read_capture(tmp_path)
    for index, camera in enumerate(cameras):
        at = projected(capture, index, index / 10, side_point_at)
        assert at == pytest.approx(camera.straight_px(side_point_at(index / 10)), abs=1e-6)
        assert middle_of_light(capture.frames.read(index).rgb) == pytest.approx(at, abs=0.12)


def test_points_of_the_file_are_read(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    fields = [(axis, "<f4") for axis in "xyz"] + [(c, "u1") for c in ("red", "green", "blue")]
    table = np.array([(*point_at(0.3), 255, 0, 51)], dtype=fields)
    lines = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    header = "\n".join([*lines, "end_header\n"]).encode()
    (tmp_path / "sparse_pc.ply").write_bytes(header + table.tobytes())
    change_json(
        tmp_path / "transforms.json", lambda root: root.update(ply_file_path="sparse_pc.ply")
    )
    points = read_capture(tmp_path).points
    np.testing.assert_allclose(points.positions[0].numpy(), point_at(0.3), atol=1e-6)
    torch.testing.assert_close(points.rgb[0], torch.tensor([1, 0, 0.2]))
    (tmp_path / "sparse_pc.ply").write_bytes(header + table.tobytes()[:-3])
    with pytest.raises(FileFormatError, match=r"sparse_pc\.ply: expected 1 rows of element"):
        read_capture(tmp_path)
    (tmp_path / "sparse_pc.ply").unlink()
    with pytest.raises(FileFormatError, match=r"sparse_pc\.ply: expected a PLY file, got no such"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"camera_model": "FISHEYE624"},
            "expected a pinhole camera_model, got 'FISHEYE624'",
        ),
        ({"k4": 0.1}, "expected no lens distortion, got k4 = 0.1"),
        ({"ply_file_path": "../points.ply"}, r"expected a path inside .*'\.\./points\.ply'"),
        ({"frames": []}, "expected 1 to 100000 camera poses, got none"),
        ({"frames": None}, "expected a list under 'frames', got nothing"),
        ({"depth_unit_scale_factor": "mm"}, "'depth_unit_scale_factor': expected a number"),
        ({"h": 30}, "expected an image shaped as its camera, 36 x 30, got 36 x 24"),
        ({"fl_x": float("inf")}, "'fl_x': expected a finite number, got inf"),
        ({"fl_x": -1}, "focal lengths above 0"),
    ],
)
def test_files_that_make_no_sense_are_refused(tmp_path: Path, change: dict, message: str) -> None:
    write_transforms(tmp_path, count=3)
    change_json(tmp_path / "transforms.json", lambda root: root.update(change))
    with pytest.raises((FileFormatError, InputError), match=message):
        read_capture(tmp_path)


def test_damaged_images_are_named(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    file = tmp_path / "images" / "frame_00002.png"
    whole = file.read_bytes()
    file.write_bytes(whole[:-30])
    capture = read_capture(tmp_path)
    with pytest.raises(FileFormatError, match=r"frame_00002\.png: expected a whole image"):
        capture.frames.read(1)
    file.write_bytes(b"")
    with pytest.raises(FileFormatError, match=r"frame_00002\.png: expected an image, got an empty"):
        read_capture(tmp_path)
    write_image(file, np.zeros((24, 36, 3), np.uint8))
    cv2.imwrite(str(file), np.zeros((24, 36, 3), np.uint16))
    with pytest.raises(FileFormatError, match="expected 8 bits per channel, got more"):
        read_capture(tmp_path).frames.read(1)
    write_image(file, np.zeros((12, 18, 3), np.uint8))
    with pytest.raises(FileFormatError, match=r"frame_00002\.png: .*images of different sizes"):
        read_capture(tmp_path)


def test_a_file_of_another_name_is_read_when_it_is_given(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    (tmp_path / "transforms.json").rename(tmp_path / "shot.json")
    assert detect_format(tmp_path / "shot.json") == "transforms"
    capture = read_capture(tmp_path / "shot.json")
    assert (len(capture), capture.name) == (3, tmp_path.name)


def test_a_frame_that_is_not_there_is_refused(tmp_path: Path) -> None:
    write_transforms(tmp_path, count=3)
    frames = read_capture(tmp_path).frames
    for index in (-1, 3):
        with pytest.raises(InputError, match=f"frame: expected 0 to 2, got {index}"):
            frames.read(index)

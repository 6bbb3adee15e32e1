"""COLMAP: binary and text, several cameras or one that moves, and no test that is none."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from capture_checks import assert_pose, assert_sees, middle_of_light, projected
from capture_folders import blob_image, seer, side_point_at, write_image
from colmap_folders import cloud, write_binary, write_moving, write_rig, write_text

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.colmap import binary_model
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import FileFormatError, InputError


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("sparse", ["sparse_", "sparse/0", "colmap/sparse/0"])
def test_the_point_lies_in_its_pixel_for_several_cameras(
    tmp_path: Path, sparse: str, text: bool
) -> None:
    cameras = write_rig(tmp_path, sparse=sparse, text=text)
    assert detect_format(tmp_path) == "colmap"
    capture = read_capture(tmp_path)
    assert capture.times_s.tolist() == pytest.approx([0, 1 / 30, 2 / 30] * 4)
    for index in range(12):
        assert_pose(capture, index, cameras[index // 3])
        assert_sees(capture, index, cameras[index // 3], (index % 3) / 30)
    np.testing.assert_allclose(capture.points.positions.numpy(), cloud(), atol=1e-6)
    torch.testing.assert_close(capture.points.rgb, torch.tensor([[1, 0.2, 0]] * 4))


def test_what_the_layout_calls_test_is_not_used_as_one(tmp_path: Path) -> None:
    write_rig(tmp_path)
    capture = read_capture(tmp_path)
    assert torch.equal(capture.held_out, capture.camera_index == 0)
    assert report_split(capture).kind == "new views"
    assert "camera 0 held out, by default" in capture.split_reason
    assert "call test are training images" in capture.split_reason
    assert any("cam01 is 0" in note for note in capture.notes)
    chosen = read_capture(tmp_path, ReadOptions(hold_out=(3,)))
    assert chosen.split_reason == "cameras 3 held out, as asked for"


@pytest.mark.parametrize("text", [False, True])
def test_the_point_lies_in_its_pixel_for_one_that_moves(tmp_path: Path, text: bool) -> None:
    cameras = write_moving(tmp_path, text=text)
    capture = read_capture(tmp_path, ReadOptions(fps=30.0))
    kept = [index for index in range(12) if index != 3]
    assert capture.times_s.tolist() == pytest.approx([index / 30 for index in kept])
    for index, original in enumerate(kept):
        assert_pose(capture, index, cameras[original])
        assert_sees(capture, index, cameras[original], original / 30)
    assert capture.held_out.nonzero().flatten().tolist() == [0, 8]
    assert any("1 of 12 images left out: COLMAP found no pose" in note for note in capture.notes)


def test_two_cameras_miss_times_and_not_one_of_them(tmp_path: Path) -> None:
    write_rig(tmp_path, count=2, frames=10)
    capture = read_capture(tmp_path)
    held = (capture.times_s[capture.held_out] * 30).round().tolist()
    assert held == [0, 8, 0, 8]
    assert report_split(capture).kind == "new times of training views"


@pytest.mark.parametrize(
    "names",
    [
        ["cam01/frame_00001.png", "cam02/frame_00001.png", "cam03/frame_00001.png"],
        ["cam01.png", "cam02.png", "cam03.png"],
        ["1.png", "2.png", "03.png"],
    ],
)
def test_images_are_known_by_folder_name_or_number(tmp_path: Path, names: list[str]) -> None:
    cameras = write_rig(tmp_path, count=3)
    images = list(zip(names, cameras, strict=True))
    write_binary(tmp_path / "sparse_", images[::-1], cloud())
    capture = read_capture(tmp_path)
    for index, camera in enumerate(cameras):
        assert_pose(capture, 3 * index, camera)


def test_a_camera_without_a_pose_is_left_out_and_said_so(tmp_path: Path) -> None:
    cameras = write_rig(tmp_path, count=4)
    named = [(f"image{number}.jpg", cameras[number - 1]) for number in (1, 2, 4)]
    write_binary(tmp_path / "sparse_", named, cloud())
    capture = read_capture(tmp_path)
    assert_pose(capture, 6, cameras[3])
    assert any("cam03 left out: the model has no pose" in note for note in capture.notes)


def test_a_camera_with_two_poses_is_refused(tmp_path: Path) -> None:
    cameras = write_rig(tmp_path, count=3)
    named = [(f"cam0{1 + n}/frame_00001.png", camera) for n, camera in enumerate(cameras)]
    same = [*named, ("cam01/frame_00002.png", cameras[0])]
    write_binary(tmp_path / "sparse_", same, cloud())
    assert len(read_capture(tmp_path)) == 9
    moved = replace(cameras[0], position=cameras[0].position + 0.1)
    write_binary(tmp_path / "sparse_", [*named, ("cam01/frame_00002.png", moved)], cloud())
    with pytest.raises(FileFormatError, match="expected one pose of cam01, got 2 that differ"):
        read_capture(tmp_path)


def test_images_that_no_folder_is_called_after_are_refused(tmp_path: Path) -> None:
    cameras = write_rig(tmp_path, count=2)
    write_binary(tmp_path / "sparse_", [("left.png", cameras[0])], cloud())
    with pytest.raises(FileFormatError, match=r"after the folders cam01, cam02, got left\.png"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    ("model", "lens"),
    [
        ("SIMPLE_PINHOLE", {}),
        ("PINHOLE", {}),
        ("SIMPLE_RADIAL", {"radial": (-0.25, 0.0, 0.0)}),
        ("RADIAL", {"radial": (-0.3, 0.2, 0.0)}),
        ("OPENCV", {"radial": (0.1, 0.2, 0.0), "tangential": (0.02, -0.02)}),
    ],
)
@pytest.mark.parametrize("text", [False, True])
def test_every_camera_model_that_can_be_read_is_straightened(
    tmp_path: Path, model: str, lens: dict, text: bool
) -> None:
    focal_px = (31.0, 34.0) if model in ("PINHOLE", "OPENCV") else (31.0, 31.0)
    cameras = [seer(0.1 * index, focal_px=focal_px, **lens) for index in range(3)]
    for index, camera in enumerate(cameras):
        write_image(tmp_path / "images" / f"{index}.png", blob_image(camera, index / 30))
    named = [(f"{index}.png", camera) for index, camera in enumerate(cameras)]
    (write_text if text else write_binary)(tmp_path / "sparse" / "0", named, cloud(), model)
    capture = read_capture(tmp_path)
    for index, camera in enumerate(cameras):
        at = projected(capture, index, index / 30, side_point_at)
        assert at == pytest.approx(camera.straight_px(side_point_at(index / 30)), abs=1e-6)
        assert middle_of_light(capture.frames.read(index).rgb) == pytest.approx(at, abs=0.12)


def test_images_that_were_made_smaller_scale_their_cameras(tmp_path: Path) -> None:
    cameras = write_rig(tmp_path, count=3, frames=1)
    for number in (1, 2, 3):
        file = tmp_path / f"cam0{number}" / "frame_00001.png"
        write_image(file, np.zeros((12, 18, 3), np.uint8))
    capture = read_capture(tmp_path)
    assert capture.cameras.size_px == (12, 18)
    assert capture.cameras.focal_px[0].tolist() == [focal / 2 for focal in cameras[0].focal_px]


@pytest.mark.parametrize("name", ["cameras", "images", "points3D"])
def test_binary_files_that_end_too_early_are_refused_wherever_they_end(
    tmp_path: Path, name: str
) -> None:
    write_moving(tmp_path, count=4)
    file = tmp_path / "sparse" / "0" / f"{name}.bin"
    whole = file.read_bytes()
    for length in {*range(1, len(whole), 37), len(whole) - 1}:
        file.write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match=rf"{name}\.bin: expected a whole binary"):
            read_capture(tmp_path)


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (10, "got THIN_PRISM_FISHEYE; let COLMAP undistort"),
        (6, "got FULL_OPENCV"),
        (99, "got number 99"),
        (-1, "got number -1"),
    ],
)
def test_other_camera_models_are_refused_by_name(tmp_path: Path, number: int, message: str) -> None:
    file = tmp_path / "cameras.bin"
    file.write_bytes(struct.pack("<QiiQQ", 1, 4, number, 36, 24) + bytes(200))
    with pytest.raises(FileFormatError, match=f"camera 4: .*{message}"):
        binary_model.read_cameras(file)


@pytest.mark.parametrize(
    ("name", "line", "message"),
    [
        ("cameras", "1 FOV 36 24 1 2 3 4 5", "line 1: expected a camera model of .* got FOV"),
        ("cameras", "1 PINHOLE 36 24 1 2 3", "line 1: expected CAMERA_ID .* with 4 PARAMS"),
        ("cameras", "1 PINHOLE", "line 1: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS"),
        ("cameras", "1 PINHOLE x 24 1 2 3 4", "line 1: expected CAMERA_ID"),
        ("images", "1 1 0 0 0 0 0 0 1", "line 1: expected IMAGE_ID"),
        ("images", "1 one 0 0 0 0 0 0 1 a.png", "line 1: expected IMAGE_ID"),
        ("images", "1 1 0 0 0 0 0 0 77 frame_0.png", r"its camera 77 among cameras\.txt"),
        ("images", "1 0 0 0 0 0 0 0 1 frame_0.png", "a unit quaternion .* got length 0"),
        ("images", "1 nan 0 0 0 0 0 0 1 frame_0.png", "a unit quaternion .* got length nan"),
        ("images", "1 1 0 0 0 inf 0 0 1 frame_0.png", "and a finite translation"),
        ("images", "1 1 0 0 0 0 0 0 1 ../../frame_0.png", "expected a path inside"),
        ("images", "1 1 0 0 0 0 0 0 1 frame_77.png", r"frame_77\.png, got no such file"),
        ("images", "# nothing", "expected images with poses, got none"),
        ("points3D", "1 2 3 x 0 0 0", "line 1: expected POINT3D_ID X Y Z R G B"),
        ("points3D", "1 2 3", "line 1: expected POINT3D_ID"),
    ],
)
def test_text_that_makes_no_sense_is_refused(
    tmp_path: Path, name: str, line: str, message: str
) -> None:
    write_moving(tmp_path, text=True)
    (tmp_path / "sparse" / "0" / f"{name}.txt").write_text(line + "\n")
    with pytest.raises(FileFormatError, match=message):
        read_capture(tmp_path)


def test_a_lens_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    write_moving(tmp_path, text=True)
    file = tmp_path / "sparse" / "0" / "cameras.txt"
    for bad in ("-30.0", "nan"):
        lines = [f"{number} PINHOLE 36 24 {bad} 30 18 12" for number in range(1, 13)]
        file.write_text("\n".join(lines))
        with pytest.raises(FileFormatError, match="expected sizes and focal lengths above 0"):
            read_capture(tmp_path)


def test_an_empty_cloud_is_none_and_another_one_is_found(tmp_path: Path) -> None:
    write_rig(tmp_path)
    file = tmp_path / "sparse_" / "points3D.bin"
    file.write_bytes(struct.pack("<Q", 0))
    capture = read_capture(tmp_path)
    assert capture.points is None
    assert any("no points and was taken as none" in note for note in capture.notes)
    file.unlink()
    header = ["ply", "format ascii 1.0", "element vertex 1"]
    header += [f"property float {axis}" for axis in "xyz"]
    ply = "\n".join([*header, "end_header", "1 2 3\n"])
    (tmp_path / "points3D_multipleview.ply").write_text(ply)
    capture = read_capture(tmp_path)
    assert capture.points.positions.tolist() == [[1, 2, 3]]
    assert any("points3D_multipleview.ply" in note for note in capture.notes)


def test_points_that_are_not_finite_are_dropped(tmp_path: Path) -> None:
    cameras = write_rig(tmp_path)
    points = cloud()
    points[1, 2] = np.nan
    write_binary(tmp_path / "sparse_", [("image1.jpg", c) for c in cameras[:1]], points)
    named = [(f"image{number}.jpg", camera) for number, camera in enumerate(cameras, start=1)]
    write_binary(tmp_path / "sparse_", named, points)
    capture = read_capture(tmp_path)
    assert len(capture.points.positions) == 3
    assert any("1 points that are not finite were dropped" in note for note in capture.notes)


def test_one_camera_alone_is_refused(tmp_path: Path) -> None:
    write_rig(tmp_path, count=1, frames=10)
    with pytest.raises(InputError, match="at least two places, got one static camera"):
        read_capture(tmp_path)

"""Nerfies and HyperNeRF: world, sizes, lens, times, and who decides what is held out."""

from pathlib import Path

import numpy as np
import pytest
import torch
from capture_checks import assert_pose, assert_sees, middle_of_light, projected
from capture_folders import (
    blob_image,
    change_json,
    point_at,
    side_point_at,
    write_hypernerf,
    write_image,
)

from diff4splat.data.capture.split import report_split
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import FileFormatError, InputError


def test_the_point_lies_in_its_pixel_and_the_given_split_is_kept(tmp_path: Path) -> None:
    cameras = write_hypernerf(tmp_path)
    assert detect_format(tmp_path) == "hypernerf"
    capture = read_capture(tmp_path)
    order = [*range(0, 16, 2), *range(1, 16, 2)]
    assert capture.times_s.tolist() == pytest.approx([index / 15 for index in range(8)] * 2)
    assert capture.camera_index.tolist() == [0] * 8 + [1] * 8
    assert capture.held_out.tolist() == [False] * 8 + [True] * 8
    for index, original in enumerate(order):
        assert_pose(capture, index, cameras[original])
        assert_sees(capture, index, cameras[original], (original // 2) / 15)
    assert report_split(capture).kind in ("new views", "new views and new times")
    assert "val_ids" in capture.split_reason
    assert any("15 frames per second were assumed" in note for note in capture.notes)
    assert any("rgb/2x are used" in note for note in capture.notes)


def test_points_lie_in_the_world_of_the_cameras(tmp_path: Path) -> None:
    write_hypernerf(tmp_path)
    capture = read_capture(tmp_path)
    want = np.stack([point_at(0.1 * index) for index in range(5)])
    np.testing.assert_allclose(capture.points.positions.numpy(), want, atol=1e-6)
    assert any("grey" in note for note in capture.notes)
    np.save(tmp_path / "points.npy", np.zeros((0, 3)))
    empty = read_capture(tmp_path)
    assert empty.points is None
    assert any("no points and was taken as none" in note for note in empty.notes)
    np.save(tmp_path / "points.npy", np.zeros((4, 2)))
    with pytest.raises(FileFormatError, match=r"points\.npy: expected an array of points x 3"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    "lens",
    [
        {"radial": (-0.25, 0.08, 0.02)},
        {"tangential": (0.02, -0.03)},
        {"skew_px": 4.0},
        {"radial": (0.2, 0.0, 0.0), "tangential": (0.01, 0.01), "skew_px": -3.0},
    ],
    ids=str,
)
def test_bent_images_are_straightened(tmp_path: Path, lens: dict) -> None:
    cameras = write_hypernerf(tmp_path, count=3, draw=blob_image, **lens)
    capture = read_capture(tmp_path)
    bent = 0.0
    for index, original in enumerate([0, 2, 4, 1, 3, 5]):
        time = (original // 2) / 15
        frame = capture.frames.read(index)
        at = projected(capture, index, time, side_point_at)
        assert at == pytest.approx(cameras[original].straight_px(side_point_at(time)), abs=1e-6)
        assert middle_of_light(frame.rgb) == pytest.approx(at, abs=0.12)
        seen = cameras[original].seen_px(side_point_at(time))
        bent = max(bent, abs(seen[0] - at[0]), abs(seen[1] - at[1]))
    assert bent > 0.25
    assert any("distortion was removed" in note for note in capture.notes)


def test_what_straightening_leaves_empty_does_not_count(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, count=2, radial=(0.4, 0.0, 0.0))
    frame = read_capture(tmp_path).frames.read(0)
    assert not bool(frame.counts[0, 0])
    assert bool(frame.counts[12, 17])
    assert frame.rgb[0, 0].tolist() == [0, 0, 0]


def test_straight_images_are_left_as_they_are(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, count=2)
    capture = read_capture(tmp_path)
    assert capture.frames.read(0).counts is None
    assert not any("distortion" in note for note in capture.notes)


def test_without_val_ids_the_usual_rule_holds(tmp_path: Path) -> None:
    cameras = write_hypernerf(tmp_path, validation=False)
    capture = read_capture(tmp_path)
    assert len(capture) == 8
    assert capture.held_out.tolist() == [False, True] * 4
    for index, original in enumerate(range(0, 16, 2)):
        assert_pose(capture, index, cameras[original])
    assert "every 4th image is learnt from" in capture.split_reason


def test_a_camera_can_be_held_out_in_place_of_val_ids(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, validation=False)
    capture = read_capture(tmp_path, ReadOptions(hold_out=(0,)))
    assert len(capture) == 16
    assert torch.equal(capture.held_out, capture.camera_index == 0)


@pytest.mark.parametrize(("downscale", "size"), [(1, (24, 36)), (2, (24, 36)), (4, (12, 18))])
def test_images_of_the_right_size_are_found_or_made(
    tmp_path: Path, downscale: int, size: tuple[int, int]
) -> None:
    cameras = write_hypernerf(tmp_path, count=2)
    capture = read_capture(tmp_path, ReadOptions(downscale=downscale))
    assert capture.cameras.size_px == size
    factor = 36 / size[1]
    column, row = cameras[0].straight_px(point_at(0.0))
    assert projected(capture, 0, 0.0) == pytest.approx((column / factor, row / factor))
    assert capture.frames.read(0).rgb.shape == (*size, 3)
    noted = any("nothing to make images at 1/1 from" in note for note in capture.notes)
    assert noted == (downscale == 1)


def test_a_side_that_does_not_halve_leaves_the_focal_length_halved(tmp_path: Path) -> None:
    cameras = write_hypernerf(tmp_path, count=2)
    for file in (tmp_path / "camera").iterdir():
        change_json(file, lambda root: root.update(image_size=[73, 49]))
    capture = read_capture(tmp_path)
    assert capture.cameras.size_px == (24, 36)
    assert capture.cameras.focal_px[0].tolist() == pytest.approx(cameras[0].focal_px, abs=1e-9)


def test_images_at_full_size_are_taken_when_they_are_there(tmp_path: Path) -> None:
    cameras = write_hypernerf(tmp_path, count=2)
    for index in range(4):
        name = f"{'left' if index % 2 == 0 else 'right'}1_{index // 2:06d}.png"
        write_image(tmp_path / "rgb" / "1x" / name, np.full((48, 72, 3), index, np.uint8))
    capture = read_capture(tmp_path)
    assert capture.cameras.size_px == (48, 72)
    assert capture.cameras.focal_px[0].tolist() == pytest.approx(
        [2 * focal for focal in cameras[0].focal_px]
    )


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        ("metadata.json", lambda root: root["left1_000001"].pop("warp_id"), "expected 'warp_id'"),
        (
            "metadata.json",
            lambda root: root.pop("left1_000001"),
            "'left1_000001': expected warp_id",
        ),
        ("dataset.json", lambda root: root.update(ids=[], train_ids=[], val_ids=[]), "under 'ids'"),
        ("dataset.json", lambda root: root.update(ids="all"), "'ids': expected a list of names"),
        ("scene.json", lambda root: root.update(scale=0), "'scale': expected a number above 0"),
        (
            "camera/left1_000000.json",
            lambda root: root.update(position=[0.0, float("nan"), 0.0]),
            r"left1_000000\.json: 'position': expected a finite number, got nan",
        ),
        (
            "camera/left1_000000.json",
            lambda root: root.update(
                orientation=[[-v for v in row] for row in root["orientation"]]
            ),
            r"left1_000000\.json: expected a right-handed rotation .*determinant -1",
        ),
        ("camera/left1_000000.json", lambda root: root.pop("focal_length"), "a focal_length and"),
        ("camera/left1_000000.json", lambda root: root.pop("orientation"), "3 rows of 3 numbers"),
        (
            "camera/left1_000000.json",
            lambda root: root.update(image_size=[72, 90]),
            "shaped as its camera",
        ),
    ],
)
def test_files_that_make_no_sense_are_refused(
    tmp_path: Path, file: str, change, message: str
) -> None:
    write_hypernerf(tmp_path, count=3)
    change_json(tmp_path / file, change)
    with pytest.raises(FileFormatError, match=message):
        read_capture(tmp_path)


def test_names_that_leave_the_folder_are_refused(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, count=3)
    name = "../../../etc/passwd"
    change_json(tmp_path / "metadata.json", lambda root: root.update({name: {"warp_id": 9}}))
    change_json(tmp_path / "dataset.json", lambda root: root["train_ids"].append(name))
    with pytest.raises(FileFormatError, match="expected a path inside"):
        read_capture(tmp_path)


def test_files_that_are_missing_are_named(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, count=2)
    (tmp_path / "rgb" / "2x" / "left1_000001.png").unlink()
    with pytest.raises(FileFormatError, match=r"the image .*left1_000001\.png, got no such file"):
        read_capture(tmp_path)
    (tmp_path / "camera" / "left1_000001.json").unlink()
    with pytest.raises(FileFormatError, match=r"left1_000001\.json: expected a JSON file, got no"):
        read_capture(tmp_path)


def test_two_images_of_one_camera_at_one_time_are_refused(tmp_path: Path) -> None:
    write_hypernerf(tmp_path, count=3)
    change_json(tmp_path / "metadata.json", lambda root: root["left1_000001"].update(warp_id=0))
    with pytest.raises(InputError, match="one image per camera and time, got two of camera 0"):
        read_capture(tmp_path)


def test_older_names_and_missing_values_are_understood(tmp_path: Path) -> None:
    cameras = write_hypernerf(tmp_path, count=2)

    def older(root: dict) -> None:
        root["tangential"] = root.pop("tangential_distortion")
        root.pop("skew")
        root.pop("radial_distortion")

    change_json(tmp_path / "camera" / "left1_000000.json", older)
    (tmp_path / "points.npy").unlink()
    capture = read_capture(tmp_path)
    assert_pose(capture, 0, cameras[0])
    assert capture.points is None

"""Names, numbers and headers of captures that are longer or larger than any honest one."""

import json
from pathlib import Path

import capture_folders
import cv2
import numpy as np
import pytest
from capture_folders import change_json, write_hypernerf, write_neu3d, write_transforms
from colmap_folders import write_moving

from diff4splat.data_prep.readers.common.intrinsics import Intrinsics, undistortion_map
from diff4splat.data_prep.readers.files.file_discovery import (
    find_image,
    images_in,
    last_number,
    natural_key,
)
from diff4splat.data_prep.readers.files.lru_cache import LruCache
from diff4splat.data_prep.readers.files.point_cloud import cloud_from_arrays
from diff4splat.data_prep.readers.files.video_file import VideoFile
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.errors import Diff4SplatError, FileFormatError
from diff4splat.evaluation.protocols.protocol_json import load_protocol as load
from diff4splat.evaluation.protocols.protocol_json import parse_protocol, protocol_json


@pytest.mark.parametrize("name", ["frame_²", "²", "frame_" + "7" * 5000, "٣٤"])
def test_odd_digits_in_names_sort_and_count(name: str) -> None:
    assert sorted(["frame_10", name, "frame_9"], key=natural_key)
    number = last_number(f"{name}.png")
    assert number is None or 0 <= number < 10**18


def test_a_capture_with_such_names_is_read(tmp_path: Path) -> None:
    write_neu3d(tmp_path, frames=2, count=2)
    image = tmp_path / "cam00" / "images" / "0000.png"
    image.rename(image.with_name("²" + "1" * 200 + ".png"))
    assert images_in(image.parent)
    assert len(read_capture(tmp_path)) == 4


@pytest.mark.parametrize("name", ["a" * 300, "b/" * 3000 + "c", "\udc80", "a\0", "../a", "", "."])
def test_names_that_no_file_can_have(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileFormatError, match="frame 0: expected"):
        find_image(tmp_path, name, "frame 0")
    write_transforms(tmp_path, count=2)
    change_json(tmp_path / "transforms.json", lambda root: root["frames"][0].update(file_path=name))
    with pytest.raises(FileFormatError, match="frame 0: expected"):
        read_capture(tmp_path)


@pytest.mark.parametrize("value", [1e300, -1e39, np.nan, np.inf])
def test_points_that_float32_cannot_hold_are_dropped(value: float) -> None:
    positions = np.array([[0.0, 1.0, 2.0], [0.0, value, 0.0]])
    cloud, notes = cloud_from_arrays(positions, None, "points")
    assert cloud.positions.tolist() == [[0.0, 1.0, 2.0]]
    assert "1 points that are not finite were dropped" in notes[0]


@pytest.mark.parametrize("side", ["9" * 5000, "9" * 4000, str(2**62), "-1", "0", "nan"])
def test_colmap_sizes_beyond_any_image(tmp_path: Path, side: str) -> None:
    write_moving(tmp_path, count=5, text=True)
    file = tmp_path / "sparse" / "0" / "cameras.txt"
    file.write_text(file.read_text().replace(" 36 24 ", f" {side} 24 "))
    with pytest.raises(FileFormatError, match="expected"):
        read_capture(tmp_path)


@pytest.mark.parametrize("size", [[10**400, 24], [1e300, 1e300], [2**62, 2**62], [0.2, 24]])
def test_nerfies_sizes_beyond_any_image(tmp_path: Path, size: list[float]) -> None:
    write_hypernerf(tmp_path, count=3)
    for file in (tmp_path / "camera").iterdir():
        change_json(file, lambda record: record.update(image_size=size))
    with pytest.raises(FileFormatError, match="expected"):
        read_capture(tmp_path)


def test_a_video_that_claims_more_frames_than_bytes(tmp_path: Path, monkeypatch) -> None:
    image = np.zeros((16, 16, 3), np.uint8)
    capture_folders.write_video(tmp_path / "a.mp4", [image] * 2, 30.0)

    class Claiming:
        def __init__(self, *arguments: object) -> None:
            self.get = {
                cv2.CAP_PROP_FRAME_COUNT: 2.0**31,
                cv2.CAP_PROP_FPS: 30.0,
                cv2.CAP_PROP_FRAME_HEIGHT: 16.0,
                cv2.CAP_PROP_FRAME_WIDTH: 16.0,
            }.get

        def isOpened(self) -> bool:  # noqa: N802
            return True

    monkeypatch.setattr(cv2, "VideoCapture", Claiming)
    with pytest.raises(FileFormatError, match=r"got 2,147,483,648 of 16 x 16 in [\d,]+ bytes"):
        VideoFile(tmp_path / "a.mp4", 1, LruCache(1 << 20))


@pytest.mark.parametrize(
    "change",
    [{"views": 10**9}, {"frames": 10**9}, {"size_px": [10**9, 10**9]}, {"frames": 10**400}],
)
def test_protocols_of_a_thousand_million_views(change: dict) -> None:
    record = json.loads(protocol_json(load("held_out_v1").protocol)) | change
    text = json.dumps(record)
    with pytest.raises(Diff4SplatError, match="expected"):
        parse_protocol(text, "p.json")


@pytest.mark.parametrize("key", ["k1", "k2", "p1", "cx", "fl_x"])
@pytest.mark.parametrize("value", [1e308, -1e308, 1e13])
def test_lenses_beyond_any_lens(tmp_path: Path, key: str, value: float) -> None:
    """LinAlgError before, where the polynomial of the lens overflows."""
    write_transforms(tmp_path, count=3)
    change_json(tmp_path / "transforms.json", lambda root: root.update({key: value}))
    with pytest.raises(FileFormatError, match="expected"):
        read_capture(tmp_path).frames.read(0)


@pytest.mark.parametrize("focal_px", [1e-12, 1e-3, 1e12])
@pytest.mark.parametrize("k1", [-1e12, -0.2, 0.0, 1e12])
def test_any_lens_within_limits_gives_a_map(focal_px: float, k1: float) -> None:
    lens = Intrinsics(
        focal_px=(focal_px, focal_px),
        center_px=(18.0, 12.0),
        size_px=(24, 36),
        radial=(k1, k1, k1),
        tangential=(1e12, -1e12),
    )
    for source in undistortion_map(lens.scaled_to((24, 36), "lens")):
        assert np.isfinite(source).all() and np.abs(source).max() <= 1e6

"""``camera.json`` as a whole: the same bits, and one line about whatever is wrong."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from filmed_scenes import filmed_scene

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.optics import Aperture, Optics
from diff4splat.io.cameras.camera_record import (
    CameraRecord,
    FrameFiles,
    read_camera_record,
    write_camera_record,
)
from diff4splat.paths.physical_path import filmed
from diff4splat.render.physical.settings import PhotoSettings


def record(frames: int = 2) -> CameraRecord:
    scene = filmed_scene(frames)
    optics = Optics(aperture=Aperture(radius=0.1, focus_distance=2.0))
    return CameraRecord(
        effect="depth-of-field",
        physical_path=filmed(scene.path, optics),
        frames=tuple(
            FrameFiles(image=f"{index}.png", geometry=f"depth/{index}.exr")
            for index in range(frames)
        ),
        geometry="depth",
        settings=PhotoSettings(samples=8, seed=3, pixel_area=True, rows_per_chunk=2),
        scene=scene.provenance,
        generator="diff4splat test",
        valid="valid.png",
        scene_time_s=1 / 3,
        intervals=4,
        interval_error_px=0.0625,
    )


def test_everything_comes_back_bit_for_bit(tmp_path: Path) -> None:
    own = record()
    write_camera_record(own, tmp_path / "camera.json")
    back = read_camera_record(tmp_path / "camera.json")
    for name in ("focal_px", "center_px", "world_from_camera"):
        assert torch.equal(
            getattr(back.physical_path.path.cameras, name),
            getattr(own.physical_path.path.cameras, name),
        )
    assert torch.equal(back.physical_path.path.times_s, own.physical_path.path.times_s)
    assert torch.equal(back.physical_path.track.times_s, own.physical_path.track.times_s)
    assert back.physical_path.optics.aperture == own.physical_path.optics.aperture
    for name in ("effect", "frames", "geometry", "settings", "scene", "generator", "valid"):
        assert getattr(back, name) == getattr(own, name)
    for name in ("scene_time_s", "intervals", "interval_error_px"):
        assert getattr(back, name) == getattr(own, name)


def test_equal_records_are_equal_bytes_and_say_what_they_mean(tmp_path: Path) -> None:
    for name in ("a.json", "b.json"):
        write_camera_record(record(), tmp_path / name)
    text = (tmp_path / "a.json").read_text()
    assert text == (tmp_path / "b.json").read_text()
    root = json.loads(text)
    assert root["license"] == "CC0-1.0"
    assert {"axes", "pixels", "units", "poses", "time", "depth"} <= set(root["conventions"])


def test_a_camera_may_have_no_way_and_no_depth(tmp_path: Path) -> None:
    own = record(1)
    own = replace(
        own,
        physical_path=replace(own.physical_path, track=None),
        frames=(FrameFiles(image="0.png"),),
        valid=None,
        scene_time_s=None,
    )
    write_camera_record(own, tmp_path / "camera.json")
    back = read_camera_record(tmp_path / "camera.json")
    assert back.physical_path.track is None
    assert back.frames == own.frames
    assert (back.valid, back.scene_time_s) == (None, None)


def test_files_and_frames_are_as_many() -> None:
    with pytest.raises(InputError, match="expected files of 2 frames, got those of 1"):
        replace(record(), frames=(FrameFiles(image="0.png"),))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("format", "other", "expected a diff4splat-camera file"),
        ("version", 2, "written by a newer diff4splat"),
        ("version", True, "'version': expected a whole number of at least 1"),
        ("size_px", [10.0], "'size_px': expected a list of 2 numbers"),
        ("size_px", [0, 5], "'size_px': expected 1 to"),
        ("geometry", "z", "'geometry': expected one of depth, distance"),
        ("frames", [], "'frames': expected a list with entries"),
        ("frames", [3], "frame 0: expected an object, got 3"),
        ("frames", [{}], "frame 0: 'focal_px': expected a list of 2 numbers"),
        ("optics", None, "'optics': expected an object, got nothing"),
        ("sampling", {}, "'seed': expected a whole number"),
        ("scene", {}, "'generator': expected text"),
        ("effect", None, "'effect': expected text"),
        ("scene_time_s", "1", "'scene_time_s': expected a number, got the text"),
        ("valid", 3, "'valid': expected text, got 3"),
    ],
)
def test_every_wrong_value_is_named_in_one_line(
    tmp_path: Path, key: str, value: object, says: str
) -> None:
    file = tmp_path / "camera.json"
    write_camera_record(record(), file)
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))
    with pytest.raises(FileFormatError) as caught:
        read_camera_record(file)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("time_s", 0.1, "expected finite times that increase"),
        ("focal_px", [-1.0, 1.0], "focal lengths above 0"),
        ("file", 7, "frame 0: 'file': expected text, got 7"),
        ("depth", 7, "frame 0: 'depth': expected text, got 7"),
        ("world_from_camera", [[0.0] * 4] * 4, "frame 0: 'world_from_camera': expected rotations"),
    ],
)
def test_every_wrong_frame_is_named(tmp_path: Path, key: str, value: object, says: str) -> None:
    file = tmp_path / "camera.json"
    write_camera_record(record(), file)
    root = json.loads(file.read_text())
    root["frames"][0][key] = root["frames"][1]["time_s"] if key == "time_s" else value
    file.write_text(json.dumps(root))
    with pytest.raises(FileFormatError) as caught:
        read_camera_record(file)
    assert says in str(caught.value)


def test_cut_off_missing_and_other_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "camera.json"
    with pytest.raises(FileFormatError, match="got no such file"):
        read_camera_record(file)
    write_camera_record(record(), file)
    whole = file.read_bytes()
    for length in (1, 40, len(whole) // 2, len(whole) - 3):
        file.write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match="expected JSON"):
            read_camera_record(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="text in UTF-8"):
        read_camera_record(file)

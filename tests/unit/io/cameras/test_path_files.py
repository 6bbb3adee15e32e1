import json
import os
from dataclasses import replace
from pathlib import Path
from typing import get_args

import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import Diff4SplatError, FileFormatError, InputError, OutputError
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import pinhole, project
from diff4splat.io.cameras import path_files
from diff4splat.io.cameras.path_files import (
    PathFormat,
    detect_format,
    format_for,
    read_path,
    write_path,
)
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathFrame, PathSettings

VIEW = pinhole(60.0, (48, 64), torch.float64)
FORMATS = get_args(PathFormat)
NAMES: dict[str, PathFormat] = {
    "a.txt": "realestate10k",
    "a.json": "transforms_json",
    "my_camera_path.json": "camera_path_json",
    "a.tum": "tum",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("paths")


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 9), st.sampled_from(FORMATS))
def test_round_trip_in_every_format(folder: Path, seed: int, count: int, form: PathFormat) -> None:
    path = oracles_paths.random_path(seed, count, centered=True)
    write_path(path, folder / "path.any", form)
    found = read_path(folder / "path.any", VIEW)
    assert oracles_paths.pose_error(found, path) < 1e-13
    assert float((found.times_s - path.times_s).abs().max()) < 1e-6
    if form != "tum":
        torch.testing.assert_close(found.cameras.focal_px, path.cameras.focal_px)
    rotation = found.cameras.world_from_camera[:, :3, :3]
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones(count, dtype=torch.float64))


@pytest.mark.parametrize("name", NAMES)
def test_what_is_in_front_stays_in_front(tmp_path: Path, name: str) -> None:
    view = PathFrame(camera=VIEW, near_depth=2.0, focus_depth=5.0)
    path = build_path("arc+spiral+backward", view, PathSettings(frames=13, fps=24.0))
    write_path(path, tmp_path / name)
    points = torch.tensor([[[0.3, -0.2, 5.0]]], dtype=torch.float64).expand(13, 1, 3)
    pixels, depth = project(read_path(tmp_path / name, VIEW).cameras, points)
    expected, expected_depth = project(path.cameras, points)
    torch.testing.assert_close(pixels, expected)
    torch.testing.assert_close(depth, expected_depth)
    assert bool((depth > 0).all())


@pytest.mark.parametrize("form", FORMATS)
def test_any_world_and_clock_begin_at_zero(tmp_path: Path, form: PathFormat) -> None:
    path = oracles_paths.random_path(7, 5, centered=True)
    somewhere = oracles_paths.random_path(8, 2).cameras.world_from_camera[1]
    moved = replace(
        path,
        cameras=path.cameras.with_pose(somewhere @ path.cameras.world_from_camera),
        times_s=path.times_s + 1000,
    )
    write_path(moved, tmp_path / "p", form)
    found = read_path(tmp_path / "p", VIEW)
    assert torch.equal(found.cameras.world_from_camera[0], torch.eye(4, dtype=torch.float64))
    assert float(found.times_s[0]) == 0.0
    assert oracles_paths.pose_error(found, path) < 1e-12
    torch.testing.assert_close(found.times_s, path.times_s, atol=2e-6, rtol=0)


def test_map_coordinates_and_clock_times_survive_float32(tmp_path: Path) -> None:
    rows = [f"{1305031102 + i / 30:.6f} {4e6 + i / 10} 5e5 100 0 0 0 1" for i in range(5)]
    (tmp_path / "walk.tum").write_text("\n".join(rows))
    found = read_path(tmp_path / "walk.tum", VIEW.to(torch.float32))
    assert found.cameras.world_from_camera.dtype == found.times_s.dtype == torch.float32
    torch.testing.assert_close(found.times_s, torch.arange(5) / 30, atol=2e-6, rtol=0)
    torch.testing.assert_close(found.cameras.position[:, 0], torch.arange(5) / 10)


def test_opengl_motion_up_is_opencv_motion_against_y(tmp_path: Path) -> None:
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[1, 1, 3] = 1.0
    frames = [{"transform_matrix": pose} for pose in poses.tolist()]
    (tmp_path / "t.json").write_text(json.dumps({"frames": frames}))
    found = read_path(tmp_path / "t.json", VIEW)
    assert found.cameras.position[1].tolist() == [0, -1, 0]


def test_the_frame_rate_stands_in_for_missing_times(tmp_path: Path) -> None:
    frames = [{"transform_matrix": torch.eye(4).tolist()}] * 3
    (tmp_path / "t.json").write_text(json.dumps({"frames": frames}))
    assert read_path(tmp_path / "t.json", VIEW, fps=4.0).times_s.tolist() == [0, 0.25, 0.5]


@pytest.mark.parametrize(("name", "form"), NAMES.items())
def test_the_name_decides_how_to_write(name: str, form: PathFormat) -> None:
    assert format_for(Path(name)) == form
    assert format_for(Path(name.upper())) == form


@pytest.mark.parametrize("form", FORMATS)
def test_the_content_decides_how_to_read(tmp_path: Path, form: PathFormat) -> None:
    write_path(oracles_paths.random_path(0, 3, centered=True), tmp_path / "x", form)
    assert detect_format((tmp_path / "x").read_text(), "x") == form


def test_a_byte_order_mark_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_bytes(b"\xef\xbb\xbf0 0 0 0 0 0 0 1\r\n")
    assert len(read_path(tmp_path / "a.tum", VIEW)) == 1


@pytest.mark.parametrize("name", ["a.npz", "a", "a.yaml"])
def test_unknown_suffixes_ask_for_a_format(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"expected a name ending in \.json, \.txt or \.tum"):
        write_path(oracles_paths.random_path(0, 3), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_unknown_formats_name_the_nearest(tmp_path: Path, as_shipped: None) -> None:
    with pytest.raises(InputError, match=r"path format: expected one of .*did you mean 'tum'"):
        write_path(oracles_paths.random_path(0, 3), tmp_path / "a", "tumm")  # type: ignore[arg-type]


def test_unusable_paths_are_not_written(tmp_path: Path) -> None:
    path = oracles_paths.random_path(0, 3)
    with pytest.raises(InputError, match="finite times that increase"):
        write_path(replace(path, times_s=path.times_s * 0), tmp_path / "a.tum")
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "camera_path.json"
    target.write_text("old")
    with pytest.raises(InputError, match="principal point in the middle"):
        write_path(oracles_paths.random_path(0, 3), target)
    assert target.read_text() == "old"
    with pytest.raises(OutputError):
        write_path(oracles_paths.random_path(0, 3), tmp_path / "camera_path.json" / "a.tum")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "expected camera poses, got an empty file"),
        (b" \n\t\n", "expected camera poses, got an empty file"),
        (b"# comment\n", "expected camera poses, got no line of numbers"),
        (b"https://example.org/video\n", "expected camera poses, got no line of numbers"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "expected a text file in UTF-8, got binary data"),
        (b"\xff\xfe0\x00 \x00", "expected a text file in UTF-8"),
        (b"0 0 0\x000 0 0 0 1", "expected a text file in UTF-8"),
        (b"1 2 3\n", r"line 1: expected 19 columns \(RealEstate10K\) or 8 \(TUM\), got 3"),
        (b"url\n\n1 2 3\n", "line 3: expected 19 columns"),
        (b"{", "line 1: expected JSON"),
        (b"[1, 2]", "expected a JSON object with frames or camera_path, got a list of 2"),
        (
            b'{"a": 1}',
            r"expected 'frames' \(transforms.json\) or 'camera_path' \(camera_path.json\)",
        ),
        (b"0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "line 2: expected finite times that increase"),
    ],
)
def test_damaged_files_are_explained(tmp_path: Path, content: bytes, words: str) -> None:
    file = tmp_path / "path.any"
    file.write_bytes(content)
    with pytest.raises(FileFormatError, match=words) as caught:
        read_path(file, VIEW)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=80))
def test_any_bytes_are_read_or_refused(folder: Path, content: bytes) -> None:
    (folder / "noise").write_bytes(content)
    try:
        read_path(folder / "noise", VIEW)
    except Diff4SplatError as error:
        assert "\n" not in str(error)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected camera poses, got no such file"):
        read_path(tmp_path / "none.json", VIEW)
    with pytest.raises(InputError, match=r"expected camera poses, got a folder"):
        read_path(tmp_path, VIEW)


def test_huge_files_are_refused_unread(tmp_path: Path) -> None:
    file = tmp_path / "huge.txt"
    with file.open("wb") as handle:
        os.truncate(handle.fileno(), path_files.MAX_BYTES + 1)
    with pytest.raises(FileFormatError, match="of at most 64 MiB, got more"):
        read_path(file, VIEW)


def test_times_too_fine_for_float32_are_refused(tmp_path: Path) -> None:
    path = oracles_paths.random_path(0, 3)
    fine = torch.tensor([0.0, 1000.0, 1000.000001], dtype=torch.float64)
    write_path(CameraPath(cameras=path.cameras, times_s=fine), tmp_path / "a.tum")
    assert len(read_path(tmp_path / "a.tum", VIEW)) == 3
    with pytest.raises(InputError, match="finite times that increase"):
        read_path(tmp_path / "a.tum", VIEW.to(torch.float32))


def test_the_inverse_pose_of_a_path_is_not_the_path(tmp_path: Path) -> None:
    """Guards the direction: a reader that mixed up the two conventions would pass a round trip."""
    path = oracles_paths.random_path(3, 2, centered=True)
    write_path(path, tmp_path / "a.txt")
    stored = torch.tensor(
        [float(w) for w in (tmp_path / "a.txt").read_text().split("\n")[2].split()]
    )
    expected = rigid.invert(path.cameras.world_from_camera)[1, :3].flatten()
    torch.testing.assert_close(stored[7:].double(), expected, rtol=1e-5, atol=1e-5)

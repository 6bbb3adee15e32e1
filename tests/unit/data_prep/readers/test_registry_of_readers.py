"""Which format a folder is in, and options that make no sense."""

import inspect
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from capture_folders import write_dnerf, write_hypernerf, write_neu3d, write_transforms
from colmap_folders import write_moving, write_rig

from diff4splat.data_prep.readers import registry
from diff4splat.data_prep.readers.options import FormatName, ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import ConfigError, FileFormatError, InputError

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "captures.md"


def test_an_empty_or_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a capture, got an empty folder"):
        detect_format(tmp_path)
    with pytest.raises(InputError, match="expected a capture, got no such folder"):
        read_capture(tmp_path / "nowhere")


def test_an_unknown_folder_is_refused_with_what_each_format_looks_like(tmp_path: Path) -> None:
    (tmp_path / "holiday.jpg").write_bytes(b"x")
    with pytest.raises(InputError, match="got none of these") as caught:
        detect_format(tmp_path)
    message = str(caught.value)
    assert all(f"{name}: " in message for name in get_args(FormatName))
    assert "poses_bounds.npy" in message
    assert "sparse/0" in message
    assert "\n" not in message


def test_a_folder_of_two_formats_needs_a_name(tmp_path: Path) -> None:
    write_neu3d(tmp_path)
    write_transforms(tmp_path, count=3)
    with pytest.raises(InputError, match=r"files of 2 \(neu3d: .*; transforms: .*name the format"):
        read_capture(tmp_path)
    assert read_capture(tmp_path, ReadOptions(format="neu3d")).source == "Neural 3D Video"
    assert read_capture(tmp_path, ReadOptions(format="transforms")).source == "nerfstudio"


@pytest.mark.parametrize(
    ("write", "name", "file"),
    [
        (write_dnerf, "dnerf", "transforms_test.json"),
        (write_neu3d, "neu3d", "poses_bounds.npy"),
        (write_hypernerf, "hypernerf", "dataset.json"),
        (write_transforms, "transforms", "transforms.json"),
        (write_rig, "colmap", "sparse_/cameras.bin"),
        (write_moving, "colmap", "sparse/0/images.bin"),
    ],
)
def test_folders_and_their_files_are_known(tmp_path: Path, write, name: str, file: str) -> None:
    write(tmp_path)
    assert detect_format(tmp_path) == name
    if "/" not in file:
        assert detect_format(tmp_path / file) == name


def test_the_wrong_format_is_refused(tmp_path: Path) -> None:
    write_dnerf(tmp_path)
    with pytest.raises(FileFormatError, match=r"expected cameras and images .* got less"):
        read_capture(tmp_path, ReadOptions(format="colmap"))
    with pytest.raises(FileFormatError, match=r"transforms\.json: expected a JSON file, got no"):
        read_capture(tmp_path, ReadOptions(format="transforms"))
    with pytest.raises(FileFormatError, match=r"dataset\.json: expected a JSON file, got no such"):
        read_capture(tmp_path, ReadOptions(format="hypernerf"))
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        read_capture(tmp_path, ReadOptions(format="clips"))
    with pytest.raises(FileFormatError, match=r"expected videos or images of cameras"):
        read_capture(tmp_path, ReadOptions(format="neu3d"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "dnref"}, "did you mean 'dnerf'"),
        ({"downscale": 0}, "downscale: expected at least 1, got 0"),
        ({"frame_step": -1}, "frame_step: expected at least 1, got -1"),
        ({"fps": 0.0}, "fps: expected a finite rate above 0"),
        ({"fps": float("nan")}, "fps: expected a finite rate above 0"),
        ({"background": (0.0, 2.0, 0.0)}, "background: expected RGB from 0 to 1"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ReadOptions(**options)


@pytest.mark.parametrize("factor", [2, 5])
def test_blocks_of_pixels_become_their_mean(tmp_path: Path, factor: int) -> None:
    write_transforms(tmp_path, count=3)
    full = read_capture(tmp_path)
    small = read_capture(tmp_path, ReadOptions(downscale=factor))
    height, width = 24 // factor, 36 // factor
    assert small.cameras.size_px == (height, width)
    want = full.frames.read(1).rgb[: height * factor, : width * factor]
    want = want.reshape(height, factor, width, factor, 3).mean((1, 3))
    np.testing.assert_allclose(small.frames.read(1).rgb.numpy(), want.numpy(), atol=1e-6)
    np.testing.assert_allclose(small.cameras.center_px * factor, full.cameras.center_px)
    assert any("rows or columns were cut" in note for note in small.notes) == (factor == 5)
    with pytest.raises(ConfigError, match="a downscale of at most 24, since images are 36 x 24"):
        read_capture(tmp_path, ReadOptions(downscale=25))


def test_the_page_lists_every_format_and_option() -> None:
    text = PAGE.read_text()
    for name in (*get_args(FormatName), *inspect.signature(ReadOptions).parameters):
        assert f"`{name}`" in text, name
    words = set(re.findall(r"`([\w./]+)`", text))
    assert {"transforms_test.json", "poses_bounds.npy", "dataset.json", "sparse/0"} <= words
    assert set(registry._READERS) == set(get_args(FormatName))

"""Tensors of dtypes that a scene file has no use for, and numbers that no float can hold."""

import json
import struct
from pathlib import Path

import oracles_io
import pytest
import torch
from safetensors.torch import load_file, save_file

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import read_metadata, read_tensors


@pytest.fixture
def file(tmp_path: Path) -> Path:
    save_scene(oracles_io.scene(), tmp_path / "a.safetensors")
    return tmp_path / "a.safetensors"


def _stored_as(file: Path, name: str, dtype: torch.dtype) -> None:
    tensors, metadata = load_file(file), read_metadata(file)
    tensors[name] = tensors[name].to(dtype)
    save_file(tensors, file, metadata)


@pytest.mark.parametrize(
    "dtype", [torch.float8_e4m3fn, torch.float8_e5m2, torch.bfloat16, torch.float16, torch.bool]
)
@pytest.mark.parametrize("name", ["time_deviations_s", "means", "offsets", "moving_index", "sh"])
def test_exotic_dtypes_are_refused_at_the_door(file: Path, name: str, dtype: torch.dtype) -> None:
    if name == "time_deviations_s":
        tensors = load_file(file) | {name: torch.ones(4)}
        save_file(tensors, file, read_metadata(file))
    _stored_as(file, name, dtype)
    with pytest.raises(FileFormatError, match=rf"a\.safetensors: {name}: expected one of F64, I64"):
        load_scene(file)


def test_key_frames_of_another_precision_are_refused(file: Path) -> None:
    for name in ("offsets", "rotations", "log_scale_offsets"):
        _stored_as(file, name, torch.float64)
    with pytest.raises(FileFormatError, match="motion: expected the dtype of means"):
        load_scene(file)


@pytest.mark.parametrize("digits", [310, 5000])
def test_whole_numbers_that_no_float_can_hold(file: Path, digits: int) -> None:
    """OverflowError before."""
    metadata = read_metadata(file)
    huge = '"rendering": {"dilation_px2": ' + "9" * digits + "}"
    metadata["scene"] = "{" + huge + "," + metadata["scene"].lstrip("{")
    save_file(load_file(file), file, metadata)
    with pytest.raises(FileFormatError, match="dilation_px2"):
        load_scene(file)


def test_shapes_that_no_tensor_can_have(tmp_path: Path) -> None:
    for shape in ([1 << 63, 0], [0, 1 << 62, 8], [(1 << 64) - 1, 0]):
        entry = {"a": {"dtype": "F32", "shape": shape, "data_offsets": [0, 0]}}
        text = json.dumps(entry).encode()
        (tmp_path / "a.safetensors").write_bytes(struct.pack("<Q", len(text)) + text)
        try:
            read_tensors(tmp_path / "a.safetensors")
        except FileFormatError as error:
            assert "expected a whole" in str(error)


def test_more_axes_than_any_tensor_has(tmp_path: Path) -> None:
    save_file({"a": torch.ones((1,) * 17)}, tmp_path / "a.safetensors")
    with pytest.raises(FileFormatError, match="a: expected at most 16 axes, got 17"):
        read_tensors(tmp_path / "a.safetensors")

"""Coded scene files that are damaged, hostile or of the future are refused by name."""

import json
import zlib
from collections.abc import Callable
from pathlib import Path

import coded_scenes
import pytest
import torch

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("coded") / "s.safetensors"
    save_scene(coded_scenes.scene(k=1), file, "standard")
    return file


def refusal(whole: Path, file: Path, tensors: dict | None = None, **entry: object) -> str:
    """What is said of the file with other tensors, and another entry for the means."""
    metadata, stored = dict(read_metadata(whole)), read_tensors(whole) | (tensors or {})
    document = json.loads(metadata["scene"])
    document["encodings"]["means"] |= entry
    stored = {name: value for name, value in stored.items() if value is not None}
    content = TensorFile(tensors=stored, metadata=metadata | {"scene": json.dumps(document)})
    write_tensors(content, file)
    with pytest.raises(FileFormatError) as caught:
        load_scene(file)
    assert str(file) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"transform": "wavelet"}, "expected transform value, probability, log, smallest_three"),
        ({"transform": 3}, "'transform': expected text"),
        ({"dtype": "F16"}, "expected dtype F32, F64, I64, got 'F16'; update diff4splat"),
        ({"shape": [2**39, 2**39, 3]}, "expected at most"),
        ({"shape": [60_000_000, 3]}, "fill the memory"),
        ({"shape": [400, 0]}, "shape of 1 to 4 numbers above 0"),
        ({"shape": [400, -3]}, "shape of 1 to 4 numbers above 0"),
        ({"shape": [400, 3.0]}, "shape of 1 to 4 numbers above 0"),
        ({"shape": []}, "shape of 1 to 4 numbers above 0"),
        ({"shape": [10**400]}, "shape of 1 to 4 numbers above 0"),
        ({"shape": [399, 3]}, "means: expected 2394 bytes, got more"),
        ({"shape": [401, 3]}, "means: expected 2406 bytes, got less"),
        ({"columns": 0}, "expected columns from 1"),
        ({"columns": 7}, "expected columns that divide the shape"),
        ({"block_rows": 0}, "expected block_rows from 1"),
        ({"block_rows": 10}, "means.low: expected shape (40, 3)"),
        ({"block_rows": None}, "expected block_rows from 1"),
        ({"planes": 5}, "expected planes from 0 to 4, got 5"),
        ({"planes": 1}, "means: expected 1200 bytes, got more"),
        ({"planes": True}, "'planes': expected a whole number"),
        ({"dtype": "I64"}, "means: expected float32 or float64, got int64"),
    ],
)
def test_entries(whole: Path, tmp_path: Path, entry: dict, message: str) -> None:
    assert message in refusal(whole, tmp_path / "s.safetensors", **entry)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("means.low", lambda low: None, "means.low: expected this tensor"),
        ("means.low", lambda low: low * torch.nan, "means.low: expected finite numbers"),
        ("means.low", lambda low: low[:, :2].contiguous(), "means.low: expected shape (1, 3)"),
        ("means.step", lambda step: step.expand(1, 2).clone(), "means.step: expected 1 or 3"),
        ("means.step", lambda step: step + torch.inf, "means.step: expected finite numbers"),
        ("means.step", lambda step: step * 0 + 1e307, "means: expected finite numbers"),
        ("means.planes", lambda planes: planes[:-9].clone(), "means: "),
        ("means.planes", lambda planes: planes + 1, "means: damaged bytes"),
        ("means.planes", lambda planes: planes.long(), "means.planes: expected a row of bytes"),
        ("means.planes", lambda planes: None, "means.planes: expected a row of bytes, got nothing"),
        ("scales.low", lambda low: low + 1e5, "scales: expected finite numbers"),
        ("quats.low", lambda low: low + 9, "quats: expected largest components from 0 to 3"),
        ("quats.step", lambda step: step * 1e3, "quats: expected"),
        ("moving_index.low", lambda low: low + 1e300, "moving_index: expected whole numbers"),
    ],
)
def test_tensors(whole: Path, tmp_path: Path, name: str, change: Callable, message: str) -> None:
    changed = {name: change(read_tensors(whole)[name])}
    assert message in refusal(whole, tmp_path / "s.safetensors", changed)


def test_a_plain_and_a_coded_tensor_of_one_name(whole: Path, tmp_path: Path) -> None:
    plain = {"means": torch.zeros(400, 3)}
    assert "got a plain and a coded one" in refusal(whole, tmp_path / "s.safetensors", plain)


def test_no_more_is_unpacked_than_the_entry_says(whole: Path, tmp_path: Path) -> None:
    bomb = torch.frombuffer(bytearray(zlib.compress(bytes(10**8), 9)), dtype=torch.uint8)
    said = refusal(whole, tmp_path / "s.safetensors", {"means.planes": bomb})
    assert "means: expected 2400 bytes, got more" in said


def test_unknown_keys_and_tensors_are_ignored(whole: Path, tmp_path: Path) -> None:
    metadata, tensors = dict(read_metadata(whole)), read_tensors(whole)
    document = json.loads(metadata["scene"])
    document["encodings"]["means"]["remark"] = {"of": "the future"}
    del document["compression"]
    metadata["scene"] = json.dumps(document)
    content = TensorFile(tensors=tensors | {"remark": torch.zeros(2)}, metadata=metadata)
    write_tensors(content, tmp_path / "s.safetensors")
    same, want = load_scene(tmp_path / "s.safetensors"), load_scene(whole)
    assert torch.equal(same.gaussians.means, want.gaussians.means)

"""Scene files that are not whole, not ours or not honest: one line each, never a traceback."""

import json
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import oracles_io
import pytest
import torch
from safetensors.torch import save_file

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    save_scene(oracles_io.scene(), tmp_path / "scene.safetensors")
    return tmp_path / "scene.safetensors"


def refusal(file: Path) -> str:
    with pytest.raises(FileFormatError) as caught:
        load_scene(file)
    message = str(caught.value)
    assert message.isprintable()
    assert str(file) in message
    return message


def changed(file: Path, tensors: dict[str, Any] | None = None, **strings: str | None) -> Path:
    """The same file with other tensors (None removes one) and other metadata strings."""
    merged = {**read_tensors(file), **(tensors or {})}
    texts = {**read_metadata(file), **strings}
    content = TensorFile(
        tensors={name: value for name, value in merged.items() if value is not None},
        metadata={name: text for name, text in texts.items() if text is not None},
    )
    write_tensors(content, file)
    return file


def changed_json(file: Path, *keys: str, value: Any) -> Path:
    """The same file with one value of the JSON part replaced; ``...`` removes it."""
    document = json.loads(read_metadata(file)["scene"])
    inner = document
    for key in keys[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return changed(file, scene=json.dumps(document))


def test_truncation_anywhere_is_noticed(file: Path) -> None:
    whole = file.read_bytes()
    assert len(whole) > 1000
    for length in [*range(120), *range(120, len(whole), 7), len(whole) - 1]:
        file.write_bytes(whole[:length])
        message = refusal(file)
        expected = (
            "an empty file" if length == 0 else "only the first" if length < 100 else "expected"
        )
        assert expected in message


def test_missing_folder_and_empty(tmp_path: Path) -> None:
    assert "got no such file" in refusal(tmp_path / "nothing.safetensors")
    assert "got a folder" in refusal(tmp_path)
    (tmp_path / "empty.safetensors").touch()
    assert "got an empty file" in refusal(tmp_path / "empty.safetensors")


def test_random_bytes_and_other_kinds(tmp_path: Path) -> None:
    source = random.Random(0)
    file = tmp_path / "x.safetensors"
    for length in (1, 8, 9, 100, 5000):
        file.write_bytes(source.randbytes(length))
        assert "expected" in refusal(file)
    file.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    assert "got another kind of file" in refusal(file)
    save_file({"weight": torch.ones(2)}, file)
    assert "expected format 'diff4splat-scene', got a .safetensors file without" in refusal(file)
    save_file({"weight": torch.ones(2)}, file, {"format": "pt"})
    assert "got format 'pt'" in refusal(file)


def test_an_absurdly_large_header_is_refused_without_reading_it(file: Path) -> None:
    file.write_bytes((1 << 60).to_bytes(8, "little") + b'{"a"')
    assert "expected a header of at most 100000000 bytes" in refusal(file)


def test_damaged_bytes_never_end_in_another_exception(file: Path) -> None:
    whole, source = file.read_bytes(), random.Random(1)
    for _ in range(300):
        damaged = bytearray(whole)
        for _ in range(3):
            damaged[source.randrange(len(damaged))] = source.randrange(256)
        file.write_bytes(damaged)
        try:
            load_scene(file)
        except FileFormatError as error:
            assert str(error).isprintable()


def test_a_newer_version_says_so(file: Path) -> None:
    assert (
        "written by a newer diff4splat (version 3, this one reads up to 2); update diff4splat"
        in refusal(changed(file, version="3"))
    )


@pytest.mark.parametrize("version", [None, "", "0", "-1", "1.5", "two", "²", "9" * 5000])
def test_a_version_that_is_no_number(file: Path, version: str | None) -> None:
    assert "expected a version number" in refusal(changed(file, version=version))


@pytest.mark.parametrize("text", [None, "", "{", "not json", "[" * 100_000, "9" * 5000])
def test_metadata_that_is_no_json(file: Path, text: str | None) -> None:
    assert re.search("expected (a )?JSON", refusal(changed(file, scene=text)))


@pytest.mark.parametrize("text", ["[]", "3", "null", '"text"'])
def test_metadata_that_is_no_object(file: Path, text: str) -> None:
    assert "expected a JSON object" in refusal(changed(file, scene=text))


@pytest.mark.parametrize(
    ("keys", "value", "says"),
    [
        (("provenance",), ..., "'provenance': expected an object, got nothing"),
        (("provenance", "generator"), 3, "'generator': expected text, got 3"),
        (("provenance", "seed"), True, "'seed': expected a whole number or null, got True"),
        (("provenance", "untrained"), 1, "'untrained': expected true or false, got 1"),
        (("path",), [], "'path': expected an object"),
        (("path", "size_px"), [4], "'size_px': expected 2 whole numbers, got [4]"),
        (("path", "size_px"), [4.5, 4], "'size_px': expected 2 whole numbers"),
        (("path", "size_px"), [True, 4], "'size_px': expected 2 whole numbers"),
        (("path", "size_px"), [0, 4], "path.size_px: expected 1 to 16384 pixels per side"),
        (("rendering",), 0.3, "'rendering': expected an object"),
        (("rendering",), {"dilation_px2": "wide"}, "'dilation_px2': expected a number, got 'wide'"),
        (
            ("rendering",),
            {"dilation_px2": -0.1},
            "rendering.dilation_px2: expected a finite number",
        ),
        (("rendering",), {"dilation_px2": float("inf")}, "expected a finite number of at least 0"),
        (("rendering",), {"dilation_px2": True}, "'dilation_px2': expected a number, got True"),
        (("motion",), "still", "'motion': expected an object"),
        (("motion", "kind"), ..., "'kind': expected text, got nothing"),
        (("motion", "kind"), "jelly", "got 'jelly'; update diff4splat"),
        (("motion", "interpolation"), "guess", "expected linear or cubic, got 'guess'"),
    ],
)
def test_metadata_values_of_the_wrong_kind(
    file: Path, keys: tuple[str, ...], value: Any, says: str, as_shipped: None
) -> None:
    assert says in refusal(changed_json(file, *keys, value=value))


@pytest.mark.parametrize(
    "times", [[1.0, 0.0], [0.0], [0.0, 1e999], [float("nan"), 1.0], [0, 10**400], ["a", "b"]]
)
def test_time_ranges_that_make_no_sense(tmp_path: Path, times: list[Any]) -> None:
    file = tmp_path / "s.safetensors"
    save_scene(oracles_io.scene(moving=False), file)
    assert "'time_range_s': expected" in refusal(
        changed_json(file, "motion", "time_range_s", value=times)
    )


def test_unknown_additions_are_ignored(file: Path) -> None:
    changed_json(file, "provenance", "colour_of_the_sky", value="blue")
    load_scene(changed(file, tensors={"extra": torch.ones(3)}, remark="hello"))


ALL_TENSORS = [
    *("means", "quats", "scales", "opacities", "sh"),
    *("key_times_s", "moving_index", "offsets", "rotations", "log_scale_offsets"),
    *("path_focal_px", "path_center_px", "path_world_from_camera", "path_times_s"),
]


@pytest.mark.parametrize("name", ALL_TENSORS)
def test_a_missing_tensor_is_named(file: Path, name: str) -> None:
    assert f"{name}: expected this tensor" in refusal(changed(file, tensors={name: None}))


@pytest.mark.parametrize("name", ALL_TENSORS)
def test_a_tensor_of_another_type_is_named(file: Path, name: str) -> None:
    other = torch.float32 if name == "moving_index" else torch.int64
    tensors = {name: read_tensors(file)[name].to(other)}
    assert f"{name}: expected" in refusal(changed(file, tensors=tensors))


@pytest.mark.parametrize("name", ALL_TENSORS)
def test_a_tensor_of_another_shape_is_refused(file: Path, name: str, as_shipped: None) -> None:
    value = read_tensors(file)[name]
    assert "expected" in refusal(changed(file, tensors={name: value[..., None]}))
    assert "expected" in refusal(changed(file, tensors={name: value[:-1]}))


@pytest.mark.parametrize("name", [name for name in ALL_TENSORS if name != "moving_index"])
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_a_number_that_is_not_finite_is_named_and_counted(
    file: Path, name: str, bad: float
) -> None:
    value = read_tensors(file)[name]
    value.view(-1)[-1] = bad
    says = f"{name}: expected finite numbers, got 1 of {value.numel()} NaN or infinite"
    assert says in refusal(changed(file, tensors={name: value}))


@pytest.mark.parametrize(
    ("index", "says"),
    [
        ([1, 4], "expected indices from 0 to 3, got 4"),
        ([-1, 1], "expected indices from 0 to 3, got -1"),
        ([3, 1], "expected increasing indices"),
        ([1, 1], "expected increasing indices"),
    ],
)
def test_moving_indices_out_of_range_or_order(file: Path, index: list[int], says: str) -> None:
    tensors = {"moving_index": torch.tensor(index)}
    assert f"moving_index: {says}" in refusal(changed(file, tensors=tensors))


def test_a_number_of_harmonics_of_no_degree(file: Path, as_shipped: None) -> None:
    assert "Gaussians.sh: expected" in refusal(changed(file, tensors={"sh": torch.zeros(4, 5, 3)}))


def test_times_that_go_back_and_poses_that_are_none(file: Path) -> None:
    back = {"key_times_s": torch.tensor([0.0, 2.0, 1.0])}
    assert "key_times_s: expected at least one time, strictly" in refusal(
        changed(file, tensors=back)
    )
    still = {"key_times_s": torch.tensor([0.0, 1.0, 2.0]), "path_times_s": torch.tensor([1.0, 1.0])}
    assert "path: expected finite times that increase" in refusal(changed(file, tensors=still))
    flat = {
        "path_times_s": torch.tensor([0.0, 1.0]),
        "path_world_from_camera": torch.zeros(2, 4, 4),
    }
    assert "path: expected rotations" in refusal(changed(file, tensors=flat))


@pytest.mark.parametrize(
    ("name", "change", "word"),
    [
        ("opacities", lambda tensor: tensor + 5, "probabilities"),
        ("opacities", lambda tensor: tensor - 5, "probabilities"),
        ("scales", lambda tensor: tensor - 5, "standard deviations"),
        ("means", lambda tensor: tensor.double(), "one dtype"),
    ],
)
def test_values_that_are_not_activated_and_mixed_dtypes(
    tmp_path: Path, name: str, change: Callable, word: str
) -> None:
    save_scene(oracles_io.scene(), tmp_path / "s.safetensors")
    tensors = dict(read_tensors(tmp_path / "s.safetensors"))
    tensors[name] = change(tensors[name])
    content = TensorFile(tensors=tensors, metadata=read_metadata(tmp_path / "s.safetensors"))
    write_tensors(content, tmp_path / "t.safetensors")
    with pytest.raises(FileFormatError, match=word):
        load_scene(tmp_path / "t.safetensors")

"""Scene files of HexPlane motion: exact, for ever readable, and refused when wrong."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import oracles_hexplane
import pytest
import torch
from oracles_hexplane import GOLDEN, file_scene

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.static import StaticMotion

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "scene-format.md"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    save_scene(file_scene(), tmp_path / "scene.safetensors")
    return tmp_path / "scene.safetensors"


def refusal(file: Path) -> str:
    with pytest.raises(FileFormatError) as caught:
        load_scene(file)
    message = str(caught.value)
    assert message.isprintable() and str(file) in message
    return message


def with_tensor(file: Path, name: str, value: torch.Tensor | None) -> Path:
    merged = {**read_tensors(file), name: value}
    kept = {key: tensor for key, tensor in merged.items() if tensor is not None}
    write_tensors(TensorFile(tensors=kept, metadata=read_metadata(file)), file)
    return file


def with_setting(file: Path, key: str, value: Any) -> Path:
    metadata = dict(read_metadata(file))
    document = json.loads(metadata["scene"])
    document["motion"].pop(key)
    if value is not ...:
        document["motion"][key] = value
    metadata["scene"] = json.dumps(document)
    write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
    return file


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("compatible", [False, True])
def test_a_scene_comes_back_exactly(tmp_path: Path, dtype: torch.dtype, compatible: bool) -> None:
    scene = file_scene(dtype)
    motion: HexPlaneMotion = scene.motion
    if compatible:
        bounds = motion.planes.bounds.flip(0)
        planes = replace(
            motion.planes, time_mapping="half", bounds=bounds, time_range_s=(-1.0, 7.0)
        )
        motion = replace(motion, planes=planes, rotation="additive")
    save_scene(replace(scene, motion=motion), tmp_path / "s.safetensors")
    back = load_scene(tmp_path / "s.safetensors").motion
    assert isinstance(back, HexPlaneMotion)
    named = motion.tensors()
    assert list(back.tensors()) == list(named)
    for name, tensor in back.tensors().items():
        assert tensor.dtype == dtype and torch.equal(tensor, named[name]), name
    assert torch.equal(back.planes.bounds, motion.planes.bounds)
    assert torch.equal(back.moving_index, motion.moving_index)
    assert (back.rotation, back.time_range_s) == (motion.rotation, motion.time_range_s)
    assert back.planes.time_mapping == motion.planes.time_mapping


def test_motions_that_are_being_learned_can_be_saved(tmp_path: Path) -> None:
    scene = file_scene()
    leaves = {name: t.clone().requires_grad_() for name, t in scene.motion.tensors().items()}
    save_scene(replace(scene, motion=scene.motion.with_tensors(leaves)), tmp_path / "s.safetensors")
    assert (tmp_path / "s.safetensors").read_bytes() == GOLDEN.read_bytes()


def test_the_committed_file_keeps_loading_with_its_values(tmp_path: Path) -> None:
    scene = load_scene(GOLDEN)
    motion = scene.motion
    assert motion.moving_index.tolist() == [1, 3]
    assert motion.time_range_s == (0.0, 2.0)
    assert [tuple(plane.shape) for plane in motion.planes.levels[1]] == [
        (6, 4, 2), (4, 4, 2), (2, 4, 2), (4, 6, 2), (2, 6, 2), (2, 4, 2)
    ]  # fmt: skip
    assert motion.planes.levels[0][1][1, 0].tolist() == [0.5625, 0.578125]
    assert motion.decoder.heads["color"][1].weight[0].tolist() == [-0.25, -0.234375]
    state, want = scene.state_at(0.5), oracles_hexplane.state(motion, scene.gaussians, 0.5)
    for name, value in want.items():
        torch.testing.assert_close(getattr(state, name), torch.from_numpy(value))
    save_scene(file_scene(), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == GOLDEN.read_bytes()


@pytest.mark.parametrize("compression", ["lossless", "standard"])
def test_motion_of_nobody_is_stored_as_static(compression: str, tmp_path: Path) -> None:
    scene = file_scene().select(torch.tensor([True, False, True, False]))
    save_scene(scene, tmp_path / "s.safetensors", compression)
    assert load_scene(tmp_path / "s.safetensors").motion == StaticMotion(time_range_s=(0.0, 2.0))


def test_every_tensor_that_is_missing_or_wrong_is_named(file: Path) -> None:
    whole = read_tensors(file)
    names = [name for name in whole if name.startswith("hexplane.") or name == "moving_index"]
    assert len(names) == 2 + 12 + 2 + 3 * 4
    for name in names:
        value = whole[name]
        integer = name == "moving_index"
        wrong = [None, value[..., None], value.to(torch.float32 if integer else torch.int64)]
        wrong += [] if integer else [torch.full_like(value, torch.nan)]
        for other in wrong:
            assert f"{name}: expected" in refusal(with_tensor(file, name, other)), name
        with_tensor(file, name, value)
    load_scene(file)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("hexplane.planes.0.xy", torch.zeros(3, 3, 2), "HexPlanes.levels"),
        ("hexplane.planes.1.zt", torch.zeros(2, 4, 1), "HexPlanes.levels"),
        ("hexplane.trunk.0.weight", torch.zeros(2, 5), "decoder of 4 features"),
        ("hexplane.position.0.weight", torch.zeros(2, 3), "'position' does not fit"),
        ("hexplane.bounds", torch.zeros(2, 3, dtype=torch.float64), "dtype of means"),
        ("moving_index", torch.tensor([1, 4]), "from 0 to 3, got 4"),
    ],
)
def test_tensors_that_do_not_fit_together_are_refused(
    file: Path, name: str, value: torch.Tensor, message: str, as_shipped: None
) -> None:
    assert message in refusal(with_tensor(file, name, value))


def test_a_colour_head_must_fit_the_harmonics(file: Path) -> None:
    sh = read_tensors(file)["sh"]
    assert "expected at most 3 outputs for sh" in refusal(with_tensor(file, "sh", sh[:, :1]))
    scene = file_scene()
    plain = replace(scene.gaussians, sh=scene.gaussians.sh[:, :1])
    with pytest.raises(InputError, match="cannot be saved"):
        save_scene(replace(scene, gaussians=plain), file)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("levels", ...), ("levels", 0), ("levels", 65), ("levels", None), ("levels", "2"),
        ("levels", 3), ("trunk_layers", 2), ("trunk_layers", True), ("trunk_layers", 10**400),
        ("heads", "position"), ("heads", ["color", "position"]), ("heads", ["weight"]),
        ("heads", [[]]), ("heads", ["position", "position"]), ("heads", ["scale"]),
        ("rotation", "left"), ("rotation", ...), ("time_mapping", 1), ("time_mapping", "third"),
        ("time_range_s", [2, 1]), ("time_range_s", ...),
    ],
)  # fmt: skip
def test_settings_that_are_missing_or_wrong_are_refused(file: Path, key: str, value: Any) -> None:
    assert "expected" in refusal(with_setting(file, key, value))


def test_the_page_names_every_tensor_and_setting() -> None:
    page = PAGE.read_text(encoding="utf-8")
    heads = "position|rotation|scale|opacity|color"
    for name in read_tensors(GOLDEN):
        if name.startswith("hexplane."):
            shown = re.sub(rf"\.(?:{heads})\.", ".HEAD.", name)
            shown = re.sub(r"(planes)\.\d", r"\1.L", re.sub(r"(trunk)\.\d", r"\1.K", shown))
            stem, _, last = shown.rpartition(".")
            assert f"`{shown}`" in page or (f"`{stem}." in page and f"`.{last}`" in page), shown
    for key in json.loads(read_metadata(GOLDEN)["scene"])["motion"]:
        assert f"`motion.{key}`" in page, key

"""Scene files of native 4D Gaussians: exact, for ever readable, and refused when wrong."""

import json
import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import oracles_spacetime
import pytest
import torch

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.scene_files.motion_tensors import CODECS
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

TENSORS = ("moving_index", "velocities", "time_centers_s", "time_deviations_s", "color_waves")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    save_scene(oracles_spacetime.file_scene(), tmp_path / "scene.safetensors")
    return tmp_path / "scene.safetensors"


def refusal(file: Path) -> str:
    with pytest.raises(FileFormatError) as caught:
        load_scene(file)
    message = str(caught.value)
    assert message.isprintable()
    assert str(file) in message
    return message


def with_tensors(file: Path, **tensors: torch.Tensor | None) -> Path:
    """The same file with other tensors; None removes one."""
    merged = {**read_tensors(file), **tensors}
    kept = {name: value for name, value in merged.items() if value is not None}
    write_tensors(TensorFile(tensors=kept, metadata=read_metadata(file)), file)
    return file


def with_setting(file: Path, key: str, value: Any) -> Path:
    """The same file with another value of the motion's settings; ``...`` removes it."""
    metadata = dict(read_metadata(file))
    document = json.loads(metadata["scene"])
    document["motion"].pop(key)
    if value is not ...:
        document["motion"][key] = value
    metadata["scene"] = json.dumps(document)
    write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
    return file


def assert_same_scene(got: Scene, want: Scene) -> None:
    for field in fields(Gaussians):
        assert torch.equal(getattr(got.gaussians, field.name), getattr(want.gaussians, field.name))
    assert isinstance(got.motion, SpacetimeMotion)
    for field in fields(SpacetimeMotion):
        ours, theirs = getattr(got.motion, field.name), getattr(want.motion, field.name)
        if isinstance(theirs, torch.Tensor):
            assert ours.dtype == theirs.dtype
            assert torch.equal(ours, theirs), field.name
        else:
            assert ours == theirs, field.name


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("waves", [True, False])
def test_a_scene_comes_back_exactly(tmp_path: Path, dtype: torch.dtype, waves: bool) -> None:
    scene = oracles_spacetime.file_scene(dtype)
    odd = replace(scene.motion, period_s=1 / 3, gate=0.1, time_range_s=(-0.1, 1e9))
    scene = replace(scene, motion=odd if waves else replace(odd, color_waves=None))
    save_scene(scene, tmp_path / "s.safetensors")
    back = load_scene(tmp_path / "s.safetensors")
    assert_same_scene(back, scene)
    assert float(back.motion.time_deviations_s[1]) == math.inf
    assert ("color_waves" in read_tensors(tmp_path / "s.safetensors")) == waves


def test_the_committed_file_keeps_loading_with_its_values() -> None:
    scene = load_scene(oracles_spacetime.GOLDEN)
    motion = scene.motion
    assert isinstance(motion, SpacetimeMotion)
    assert motion.moving_index.tolist() == [1, 3]
    assert motion.velocities[1].tolist() == [-0.015625, 0.0, 0.015625]
    assert motion.time_centers_s.tolist() == [0.5, 1.25]
    assert motion.time_deviations_s.tolist() == [0.25, math.inf]
    assert motion.time_range_s == (0.0, 2.0)
    assert motion.color_waves.shape == (2, 2, 4, 3)
    assert motion.color_waves[1, 1, 3].tolist() == [0.453125, 0.46875, 0.484375]
    assert (motion.period_s, motion.gate) == (2.0, 0.05)
    late = scene.state_at(1.75)
    assert late.opacities.tolist() == [0.25, 0.0, 0.28125, 0.296875]
    # dt = 0.5 of a period of 2 s: the first wave is 0, the second −1.
    want = scene.gaussians.sh[3] - motion.color_waves[1, 1]
    torch.testing.assert_close(late.sh[3], want)
    want = scene.gaussians.means[3] + 0.5 * motion.velocities[1]
    torch.testing.assert_close(late.means[3], want)


def test_the_writer_still_makes_the_same_bytes(tmp_path: Path) -> None:
    save_scene(oracles_spacetime.file_scene(), tmp_path / "again.safetensors")
    again = (tmp_path / "again.safetensors").read_bytes()
    assert again == oracles_spacetime.GOLDEN.read_bytes()


def test_a_reader_that_does_not_know_the_kind_says_so(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(CODECS, "spacetime")
    assert "got 'spacetime'; update diff4splat" in refusal(file)
    assert read_metadata(file)["version"] == "1"


def test_motion_of_nobody_is_stored_as_static(tmp_path: Path) -> None:
    scene = oracles_spacetime.file_scene().select(torch.tensor([True, False, True, False]))
    save_scene(scene, tmp_path / "s.safetensors")
    assert load_scene(tmp_path / "s.safetensors").motion == StaticMotion(time_range_s=(0.0, 2.0))


@pytest.mark.parametrize("name", [name for name in TENSORS if name != "color_waves"])
def test_a_missing_tensor_is_named(file: Path, name: str) -> None:
    assert f"{name}: expected this tensor" in refusal(with_tensors(file, **{name: None}))


def test_a_scene_without_waves_is_whole(file: Path) -> None:
    assert load_scene(with_tensors(file, color_waves=None)).motion.color_waves is None


@pytest.mark.parametrize("name", TENSORS)
def test_a_tensor_of_another_type_or_shape_is_named(file: Path, name: str) -> None:
    value = read_tensors(file)[name]
    other = torch.float32 if name == "moving_index" else torch.int64
    whole = value.nan_to_num(posinf=1.0).to(other)
    for wrong in (whole, value[..., None]):
        assert f"{name}: expected" in refusal(with_tensors(file, **{name: wrong}))
    assert "expected" in refusal(with_tensors(file, **{name: value[:1]}))


@pytest.mark.parametrize("name", TENSORS[1:])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_only_deviations_may_be_infinite(file: Path, name: str, bad: float) -> None:
    value = read_tensors(file)[name].clone()
    value.view(-1)[0] = bad
    with_tensors(file, **{name: value})
    if name == "time_deviations_s" and bad == math.inf:
        assert load_scene(file).motion.time_deviations_s.tolist() == [math.inf, math.inf]
    else:
        says = f"{name}: expected finite numbers, got 1 of {value.numel()} NaN or infinite"
        assert says in refusal(file)


@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_deviations_are_above_zero(file: Path, bad: float) -> None:
    tensors = {"time_deviations_s": torch.tensor([bad, 1.0])}
    assert "time_deviations_s: expected seconds above 0" in refusal(with_tensors(file, **tensors))


@pytest.mark.parametrize("index", [[1, 4], [-1, 1], [3, 1], [1, 1]])
def test_indices_are_in_range_and_order(file: Path, index: list[int]) -> None:
    tensors = {"moving_index": torch.tensor(index)}
    assert "moving_index: expected" in refusal(with_tensors(file, **tensors))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("gate", ..., "'gate': expected a finite number, got nothing"),
        ("gate", "0.05", "'gate': expected a finite number, got '0.05'"),
        ("gate", True, "'gate': expected a finite number, got True"),
        ("gate", 1, r"'gate': expected a number in [0, 1), got 1.0"),
        ("gate", -0.1, r"'gate': expected a number in [0, 1), got -0.1"),
        ("gate", math.nan, "'gate': expected a finite number, got nan"),
        ("period_s", ..., "'period_s': expected a finite number, got nothing"),
        ("period_s", 0, "'period_s': expected a number above 0, got 0.0"),
        ("period_s", math.inf, "'period_s': expected a finite number, got inf"),
        ("period_s", 10**400, "'period_s': expected a finite number, got inf"),
        ("time_range_s", [2.0, 0.0], "'time_range_s': expected first ≤ last"),
        ("time_range_s", ..., "'time_range_s': expected a list, got nothing"),
    ],
)
def test_settings_that_make_no_sense(file: Path, key: str, value: Any, says: str) -> None:
    assert says in refusal(with_setting(file, key, value))


def test_whole_numbers_are_settings_too(file: Path) -> None:
    motion = load_scene(with_setting(with_setting(file, "gate", 0), "period_s", 3)).motion
    assert (motion.gate, motion.period_s) == (0.0, 3.0)


def test_waves_belong_to_the_harmonics_and_one_dtype_to_the_scene(file: Path) -> None:
    tensors = {"color_waves": torch.zeros(2, 2, 9, 3)}
    assert "color_waves: expected shape (2, any, 4, 3)" in refusal(with_tensors(file, **tensors))
    tensors = {"color_waves": torch.zeros(2, 3, 4, 3)}
    assert "color_waves: expected 1 or 2 waves, got 3" in refusal(with_tensors(file, **tensors))
    tensors = {"color_waves": None, "velocities": torch.zeros(2, 3, dtype=torch.float64)}
    says = "motion: expected the dtype of means, got float32, float64"
    assert says in refusal(with_tensors(file, **tensors))


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    scene = oracles_spacetime.file_scene()
    broken = replace(scene.motion, velocities=scene.motion.velocities * math.nan)
    with pytest.raises(InputError, match="velocities: expected finite numbers"):
        save_scene(replace(scene, motion=broken), tmp_path / "s.safetensors")
    outside = replace(scene.motion, moving_index=torch.tensor([1, 10**6]))
    with pytest.raises(InputError, match="moving_index"):
        save_scene(replace(scene, motion=outside), tmp_path / "s.safetensors")
    assert list(tmp_path.iterdir()) == []

"""Coded scene files: within their tolerances, readable from the page alone and for ever."""

from dataclasses import asdict, replace
from pathlib import Path

import coded_scenes
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from diff4splat.geometry.quaternion import to_matrix
from diff4splat.io.scene_files.coding.plans import units_per_pixel
from diff4splat.io.scene_files.coding.rows import decode_rows, encode_rows
from diff4splat.io.scene_files.coding.transforms import TRANSFORMS
from diff4splat.io.scene_files.compression import TOLERANCES
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.scene_files.tensor_file import read_metadata
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

KINDS = ("static", "keyframes", "spacetime", "hexplane")


def tensors_of(scene: Scene) -> dict[str, torch.Tensor]:
    motion = scene.motion
    named = motion.tensors() if hasattr(motion, "tensors") else {}
    if not named and hasattr(type(motion), "__slots__"):
        named = {name: getattr(motion, name) for name in type(motion).__slots__}
        named = {name: value for name, value in named.items() if isinstance(value, torch.Tensor)}
    return {name: getattr(scene.gaussians, name) for name in Gaussians.__slots__} | named


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("compression", ["standard", "small"])
def test_numbers_stay_within_their_tolerances(tmp_path: Path, kind: str, compression: str) -> None:
    scene, allowed = coded_scenes.scene(kind), TOLERANCES[compression]
    save_scene(scene, tmp_path / "s.safetensors", compression)
    got = load_scene(tmp_path / "s.safetensors").gaussians
    want, slack = scene.gaussians, 1.001
    pixel = torch.from_numpy(units_per_pixel(scene))
    assert ((got.means - want.means).norm(dim=-1) / pixel).max() <= slack * allowed.position_px
    assert (got.scales / want.scales).log().abs().max() <= slack * allowed.log_scale
    assert (got.opacities - want.opacities).abs().max() <= slack * allowed.opacity
    assert (got.sh[:, 0] - want.sh[:, 0]).abs().max() * 0.2821 <= slack * allowed.color
    assert (got.sh[:, 1:] - want.sh[:, 1:]).abs().max() <= slack * allowed.color
    axes = (to_matrix(got.quats) - to_matrix(want.quats)).norm(dim=-2).amax(-1)
    moved_px = axes * want.scales.amax(-1) / pixel
    assert moved_px.max() <= slack * allowed.rotation_px


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_reader_made_from_the_page_agrees(tmp_path: Path, kind: str, dtype: torch.dtype) -> None:
    file = tmp_path / "s.safetensors"
    save_scene(coded_scenes.scene(kind, dtype), file, "standard")
    tensors, document = coded_scenes.read_plainly(file)
    assert read_metadata(file)["version"] == "2"
    assert document["compression"] == {"name": "standard", **asdict(TOLERANCES["standard"])}
    for name, value in tensors_of(load_scene(file)).items():
        other = tensors.get(name, tensors.get(f"hexplane.{name}"))
        np.testing.assert_allclose(value.numpy(), other, rtol=1e-6, atol=1e-9, err_msg=name)
        assert value.numpy().dtype == other.dtype


def test_the_committed_file_of_version_2_keeps_loading() -> None:
    want, got = coded_scenes.scene(k=1), load_scene(coded_scenes.GOLDEN)
    assert torch.equal(got.motion.moving_index, want.motion.moving_index)
    torch.testing.assert_close(got.gaussians.means, want.gaussians.means, rtol=0, atol=0.02)
    torch.testing.assert_close(got.gaussians.sh, want.gaussians.sh, rtol=0, atol=0.008)
    for time_s in (0.0, 0.3, 1.7):
        ours, theirs = got.state_at(time_s), want.state_at(time_s)
        torch.testing.assert_close(ours.means, theirs.means, rtol=0, atol=0.02)
        torch.testing.assert_close(ours.scales, theirs.scales, rtol=0.02, atol=0)
    plain, _ = coded_scenes.read_plainly(coded_scenes.GOLDEN)
    for name, value in tensors_of(got).items():
        np.testing.assert_allclose(value.numpy(), plain[name], rtol=1e-6, atol=1e-9)


def test_equal_scenes_give_equal_bytes_and_coding_again_changes_little(tmp_path: Path) -> None:
    scene = coded_scenes.scene()
    for name in ("a", "b"):
        save_scene(scene, tmp_path / name, "standard")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    again = load_scene(tmp_path / "a")
    save_scene(again, tmp_path / "c", "standard")
    twice = load_scene(tmp_path / "c").gaussians.means
    torch.testing.assert_close(twice, scene.gaussians.means, rtol=0, atol=0.02)


def test_small_scenes_and_odd_ones_stay_plain(tmp_path: Path) -> None:
    scene = coded_scenes.scene("static")
    few = scene.select(torch.arange(len(scene.gaussians)) < 3)
    save_scene(few, tmp_path / "few", "standard")
    assert read_metadata(tmp_path / "few")["version"] == "1"
    flat = replace(scene, gaussians=replace(scene.gaussians, scales=0 * scene.gaussians.scales))
    save_scene(flat, tmp_path / "flat", "standard")
    assert torch.equal(load_scene(tmp_path / "flat").gaussians.scales, flat.gaussians.scales)
    none = scene.select(torch.zeros(len(scene.gaussians), dtype=torch.bool))
    save_scene(none, tmp_path / "none", "small")
    assert len(load_scene(tmp_path / "none").gaussians) == 0


def test_pulses_that_last_for_ever_and_lengths_of_quaternions_are_kept(tmp_path: Path) -> None:
    scene = coded_scenes.scene("spacetime")
    lasting = scene.motion.time_deviations_s.clone()
    lasting[3] = torch.inf
    scene = replace(scene, motion=replace(scene.motion, time_deviations_s=lasting))
    save_scene(scene, tmp_path / "s", "small")
    assert torch.equal(load_scene(tmp_path / "s").motion.time_deviations_s, lasting)
    field = coded_scenes.scene("hexplane")
    field = replace(field, motion=replace(field.motion, rotation="additive"))
    save_scene(field, tmp_path / "f", "small")
    assert torch.equal(load_scene(tmp_path / "f").gaussians.quats, field.gaussians.quats)


@given(
    values=arrays(np.float64, (7, 2), elements=st.floats(-1e6, 1e6)),
    step=st.floats(1e-2, 1e3),
)
@settings(max_examples=40, deadline=None)
def test_rows_come_back_within_half_a_step(values: np.ndarray, step: float) -> None:
    coded = encode_rows(values, np.full((1, 1), step))
    back = decode_rows(coded, len(values), 1024)
    assert np.abs(back - values).max() <= 0.5 * step * (1 + 1e-6) + 1e-9


def test_rows_that_no_code_holds() -> None:
    one = np.ones((1, 1))
    assert encode_rows(np.zeros((0, 3)), one) is None
    assert encode_rows(np.array([[0.0], [np.inf]]), one) is None
    assert encode_rows(np.array([[0.0], [1e10]]), one) is None
    assert encode_rows(np.array([[0.0], [1.0]]), 0 * one) is None


def test_rows_of_several_blocks_each_have_their_own_step() -> None:
    values = np.concatenate([np.linspace(0, 1, 1024), np.linspace(0, 1e6, 500)])[:, None]
    steps = np.where(np.arange(1524) < 1024, 1e-4, 10.0)[:, None]
    coded = encode_rows(values, steps)
    error = np.abs(decode_rows(coded, 1524, 1024) - values)
    assert error[:1024].max() <= 0.5e-4 * 1.001 and 1e-4 < error[1024:].max() <= 5.001


@pytest.mark.parametrize(
    "quat", [(1, 0, 0, 0), (0, 0, -2, 0), (0, 0, 0, 0), (1e-200, 0, 1e-200, 0)]
)
def test_quaternions_of_any_length(quat: tuple[float, ...]) -> None:
    code, given_quat = TRANSFORMS["smallest_three"], np.array([quat], float)
    back = torch.from_numpy(code.decode(code.encode(given_quat)))
    torch.testing.assert_close(to_matrix(back), to_matrix(torch.from_numpy(given_quat)))

"""Scene files: what goes in comes out, bit for bit, and equal scenes give equal bytes."""

import json
import os
import stat
from dataclasses import fields, replace
from pathlib import Path

import oracles_io
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.torch import load_file

from diff4splat.errors import InputError
from diff4splat.io.scene_files.motion_tensors import CODECS, MotionCodec, StoredMotion
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene


def assert_same_tensors(first: object, second: object, names: list[str]) -> None:
    for name in names:
        want, got = getattr(first, name), getattr(second, name)
        assert got.dtype == want.dtype, name
        torch.testing.assert_close(got, want, rtol=0, atol=0, msg=name)


def assert_same_scene(first: Scene, second: Scene) -> None:
    assert_same_tensors(first.gaussians, second.gaussians, [f.name for f in fields(Gaussians)])
    cameras = ["focal_px", "center_px", "world_from_camera"]
    assert_same_tensors(first.path.cameras, second.path.cameras, cameras)
    assert second.path.cameras.size_px == first.path.cameras.size_px
    assert_same_tensors(first.path, second.path, ["times_s"])
    assert second.provenance == first.provenance


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_moving_scene_comes_back_exactly(tmp_path: Path, dtype: torch.dtype) -> None:
    scene = oracles_io.scene(dtype=dtype)
    save_scene(scene, tmp_path / "s.safetensors")
    back = load_scene(tmp_path / "s.safetensors")
    assert_same_scene(scene, back)
    assert isinstance(back.motion, KeyframeMotion)
    assert back.motion.interpolation == "cubic"
    names = [f.name for f in fields(KeyframeMotion) if f.name != "interpolation"]
    assert_same_tensors(scene.motion, back.motion, names)


@pytest.mark.parametrize("dilation_px2", [0.0, 0.3, 2.5])
def test_the_dilation_it_was_made_for_comes_back(tmp_path: Path, dilation_px2: float) -> None:
    scene = replace(oracles_io.scene(), dilation_px2=dilation_px2)
    save_scene(scene, tmp_path / "s.safetensors")
    assert load_scene(tmp_path / "s.safetensors").dilation_px2 == dilation_px2


@pytest.mark.parametrize("k", [1, 4, 9, 16])
def test_a_static_scene_stores_no_keys(tmp_path: Path, k: int) -> None:
    scene = oracles_io.scene(moving=False, k=k)
    save_scene(scene, str(tmp_path / "s.safetensors"))
    assert set(load_file(tmp_path / "s.safetensors")) == {
        *("means", "quats", "scales", "opacities", "sh"),
        *("path_focal_px", "path_center_px", "path_world_from_camera", "path_times_s"),
    }
    back = load_scene(str(tmp_path / "s.safetensors"))
    assert_same_scene(scene, back)
    assert back.motion == StaticMotion(time_range_s=(0.0, 2.0))


def test_keys_that_move_nothing_are_stored_as_static(tmp_path: Path) -> None:
    scene = oracles_io.scene()
    scene = replace(scene, motion=scene.motion.select(torch.tensor([True, False, True, False])))
    scene = replace(scene, gaussians=oracles_io.gaussians(2))
    save_scene(scene, tmp_path / "s.safetensors")
    assert load_scene(tmp_path / "s.safetensors").motion == StaticMotion(time_range_s=(0.0, 2.0))


def test_no_gaussians_at_all(tmp_path: Path) -> None:
    scene = replace(oracles_io.scene(moving=False), gaussians=oracles_io.gaussians(0))
    save_scene(scene, tmp_path / "s.safetensors")
    assert len(load_scene(tmp_path / "s.safetensors").gaussians) == 0


def test_gradients_and_strides_do_not_matter(tmp_path: Path) -> None:
    scene = oracles_io.scene()
    turned = scene.gaussians.means.T.contiguous().T.requires_grad_()
    save_scene(scene, tmp_path / "a.safetensors")
    same = replace(scene, gaussians=replace(scene.gaussians, means=turned))
    save_scene(same, tmp_path / "b.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def test_equal_scenes_give_equal_bytes_that_others_may_read(tmp_path: Path) -> None:
    written = set()
    for i in range(8):
        save_scene(oracles_io.scene(), tmp_path / f"{i}.safetensors")
        written.add((tmp_path / f"{i}.safetensors").read_bytes())
    assert len(written) == 1
    (tmp_path / "plain").touch()
    modes = {stat.S_IMODE(os.stat(tmp_path / name).st_mode) for name in ("plain", "0.safetensors")}
    assert len(modes) == 1, "the scene file is not as readable as any other"


def test_the_library_reads_tensors_aligned_and_metadata_as_documented(tmp_path: Path) -> None:
    save_scene(oracles_io.scene(), tmp_path / "s.safetensors")
    raw = (tmp_path / "s.safetensors").read_bytes()
    length = int.from_bytes(raw[:8], "little")
    header = json.loads(raw[8 : 8 + length])
    assert length % 8 == 0
    for name, entry in header.items():
        width = 8 if name == "moving_index" else 4
        assert name == "__metadata__" or entry["data_offsets"][0] % width == 0
    with safe_open(tmp_path / "s.safetensors", "pt") as opened:
        metadata = opened.metadata()
    assert metadata["format"] == "diff4splat-scene"
    assert metadata["version"] == "1"
    document = json.loads(metadata["scene"])
    assert document["motion"] == {
        "kind": "keyframes",
        "interpolation": "cubic",
        "time_range_s": [0.0, 2.0],
    }
    assert document["path"] == {"size_px": [6, 8]}
    assert document["provenance"]["untrained"] is True
    assert "sRGB-referred" in document["conventions"]["color"]


@given(text=st.none() | st.text(st.characters(), max_size=20), seed=st.none() | st.integers())
@settings(max_examples=25, deadline=None)
def test_any_prompt_and_seed_survive(
    tmp_path_factory: pytest.TempPathFactory, text: str | None, seed: int | None
) -> None:
    file = tmp_path_factory.mktemp("p") / "s.safetensors"
    provenance = Provenance(generator="g", prompt=text, seed=seed)
    save_scene(replace(oracles_io.scene(moving=False), provenance=provenance), file)
    assert load_scene(file).provenance == provenance


def test_undecodable_prompts_survive_too(tmp_path: Path) -> None:
    provenance = Provenance(generator="g", prompt="caf\udce9")
    scene = replace(oracles_io.scene(moving=False), provenance=provenance)
    save_scene(scene, tmp_path / "s.safetensors")
    assert load_scene(tmp_path / "s.safetensors").provenance == provenance


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("means", float("nan"), "means: expected finite numbers, got 1 of 12 NaN or infinite"),
        ("scales", float("inf"), "scales: expected finite numbers"),
    ],
)
def test_what_could_not_be_read_back_is_not_written(
    tmp_path: Path, name: str, value: float, says: str
) -> None:
    scene = oracles_io.scene()
    broken = getattr(scene.gaussians, name).clone()
    broken[2, 1] = value
    scene = replace(scene, gaussians=replace(scene.gaussians, **{name: broken}))
    with pytest.raises(InputError, match=says):
        save_scene(scene, tmp_path / "s.safetensors")
    assert list(tmp_path.iterdir()) == []


def test_half_precision_and_motion_of_absent_gaussians_are_refused(tmp_path: Path) -> None:
    scene = oracles_io.scene()
    half = replace(scene, gaussians=scene.gaussians.to(torch.float16))
    with pytest.raises(InputError, match="expected float32 or float64, got float16"):
        save_scene(half, tmp_path / "s.safetensors")
    outside = replace(scene, motion=replace(scene.motion, moving_index=torch.tensor([1, 10**6])))
    with pytest.raises(InputError, match="moving_index"):
        save_scene(outside, tmp_path / "s.safetensors")


class Drift(StaticMotion):
    """A motion of another kind."""

    @property
    def moving_index(self) -> torch.Tensor:
        return torch.tensor([0])


def test_a_motion_without_a_codec_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(CODECS, "static")
    scene = replace(oracles_io.scene(), motion=Drift())
    with pytest.raises(InputError, match=r"expected one of .*keyframes, .*got Drift"):
        save_scene(scene, tmp_path / "s.safetensors")


def test_a_further_kind_of_motion_is_one_table_entry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    codec = MotionCodec(
        motion_type=Drift,
        pack=lambda _: StoredMotion(settings={}, tensors={"drift": torch.ones(2)}),
        unpack=lambda stored, count: Drift(
            time_range_s=(0.0, float(stored.tensors["drift"].sum()))
        ),
    )
    monkeypatch.setattr(
        "diff4splat.io.scene_files.motion_tensors.CODECS", {"drift": codec, **CODECS}
    )
    save_scene(replace(oracles_io.scene(), motion=Drift()), tmp_path / "s.safetensors")
    assert load_scene(tmp_path / "s.safetensors").motion == Drift(time_range_s=(0.0, 2.0))

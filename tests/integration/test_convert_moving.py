"""``diff4splat convert`` to files of all times, and what it says and stores of them."""

import json
from pathlib import Path

import foreign_files
import pytest
import torch
from filmed_scenes import filmed_scene

from diff4splat.cli.main import run
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "scene.safetensors"
    save_scene(filmed_scene(3), file)
    return file


@pytest.mark.parametrize(
    ("ending", "package", "floor_db"),
    [(".usdc", "pxr", 45.0), (".onnx", "onnx", 60.0), (".safetensors", "torch", 60.0)],
)
def test_the_check_is_stored(
    scene_file: Path, tmp_path: Path, ending: str, package: str, floor_db: float
) -> None:
    pytest.importorskip(package)
    out = tmp_path / f"a{ending}"
    assert run(["convert", str(scene_file), str(out)]) == 0
    check = json.loads((tmp_path / f"a{ending}.check.json").read_text())["checks"][0]
    assert check["floor_db"] == floor_db <= check["worst_db"]
    assert len({row["time_s"] for row in check["rows"]}) > 1
    assert len({row["frame"] for row in check["rows"]}) == 3


def test_a_scene_file_can_be_compressed(tmp_path: Path) -> None:
    scene, out = tmp_path / "scene.safetensors", tmp_path / "small.safetensors"
    save_scene(filmed_scene(3, side=60), scene)
    assert run(["convert", str(scene), str(out), "--compression", "small"]) == 0
    check = json.loads((tmp_path / "small.safetensors.check.json").read_text())["checks"][0]
    assert check["floor_db"] == 45.0 <= check["worst_db"]
    assert out.stat().st_size < 0.5 * scene.stat().st_size


def test_a_sequence_goes_out_and_comes_back_as_key_frames(scene_file: Path, tmp_path: Path) -> None:
    assert run(["convert", str(scene_file), str(tmp_path / "frames"), "--fps", "10"]) == 0
    assert (tmp_path / "frames" / "check.json").exists()
    assert run(["convert", str(tmp_path / "frames"), str(tmp_path / "a.safetensors")]) == 0
    motion = load_scene(tmp_path / "a.safetensors").motion
    assert isinstance(motion, KeyframeMotion) and len(motion.key_times_s) == 11


@pytest.mark.slow
def test_spacetime_gaussians_become_lines_and_key_frames_on_demand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.ply").write_bytes(foreign_files.spacetime_ply())
    assert run(["convert", str(tmp_path / "a.ply"), str(tmp_path / "a.safetensors")]) == 0
    assert "curves became lines, at most" in capsys.readouterr().err
    assert isinstance(load_scene(tmp_path / "a.safetensors").motion, SpacetimeMotion)
    assert run(["convert", str(tmp_path / "a.ply"), str(tmp_path / "b.safetensors"), "--bake"]) == 0
    assert "key times" in capsys.readouterr().err


def test_images_and_pages_are_outputs_too(scene_file: Path, tmp_path: Path) -> None:
    for name in ("a.html", "a.png", "a.gif", "a.exr"):
        assert run(["convert", str(scene_file), str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 100


def test_depth_can_be_numbered_files(scene_file: Path, tmp_path: Path) -> None:
    assert run(["render", str(scene_file), "--out", str(tmp_path / "all.exr")]) == 0
    assert run(["render", str(scene_file), "--out", str(tmp_path / "d" / "%04d.exr")]) == 0
    whole, _ = read_depth_exr(tmp_path / "all.exr")
    files = sorted((tmp_path / "d").glob("*.exr"))
    assert [file.name for file in files] == ["0000.exr", "0001.exr", "0002.exr"]
    assert torch.equal(torch.cat([read_depth_exr(file)[0] for file in files]), whole)


def test_one_output_is_needed(scene_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["convert", str(scene_file)]) == 2
    assert run(["convert", str(scene_file), "a.ply", "-o", "b.ply"]) == 2
    assert "expected one output" in capsys.readouterr().err

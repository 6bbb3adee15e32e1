"""Limits that cannot be used are refused before anything is loaded or written."""

import json
from pathlib import Path

import coded_scenes
import pytest
import torch

from diff4splat.cli.common.parser import parse
from diff4splat.cli.limits.command_work import command_work
from diff4splat.cli.limits.rendering import reach
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.cli.main import run_command
from diff4splat.errors import ConfigError, Diff4SplatError
from diff4splat.io.photos.images import write_png
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.outputs.budgets.table import find_table, write_table


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--tolerance", "0.5"), "expected a number and dB"),
        (("--tolerance", "35dB"), "a loss of 1.2 dB"),
        (("--budget", "3parsec"), "expected a number and ms or s"),
        (("--budget", "1s,2s"), "name each once"),
        (("--budget", "1s", "--calibration", "no.json"), "no.json"),
    ],
)
@pytest.mark.parametrize("command", ["generate", "render", "bake", "export html"])
def test_refusals(command: str, options: tuple[str, ...], message: str, tmp_path: Path) -> None:
    scene, out = tmp_path / "scene.safetensors", tmp_path / "out.safetensors"
    if command != "generate":
        scene.write_bytes(b"x")
    if command == "generate":
        scene, out = scene.with_suffix(".png"), tmp_path / "out"
        write_png(torch.rand(64, 64, 3), scene)
    elif command != "bake":
        out = out.with_suffix(".html" if command.startswith("export") else ".webm")
    with pytest.raises(Diff4SplatError, match=message):
        run_command([*command.split(), str(scene), "--out", str(out), *options])
    assert sorted(tmp_path.iterdir()) == [scene]


@pytest.mark.parametrize("command", ["render", "bake", "export html"])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--budget", "1ms"), r"--budget: expected at least [\d.]+ s and [\d.]+ [GM]B, which are"),
        (("--budget", "1MB"), r"--budget: expected at least .* possible, got 0.001 GB"),
    ],
)
def test_a_budget_that_nothing_fits_says_what_is_possible(
    command: str, options: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    scene, out = tmp_path / "scene.safetensors", tmp_path / "out.safetensors"
    save_scene(coded_scenes.scene("keyframes"), scene, "standard")
    if command != "bake":
        out = out.with_suffix(".html" if command.startswith("export") else ".webm")
    with pytest.raises(ConfigError, match=message):
        run_command([*command.split(), str(scene), "--out", str(out), *options])
    assert sorted(tmp_path.iterdir()) == [scene]


def test_a_tolerance_that_nothing_reaches_says_what_is_possible(tmp_path: Path) -> None:
    scene, out = tmp_path / "scene.safetensors", tmp_path / "out.safetensors"
    save_scene(coded_scenes.scene("spacetime"), scene, "standard")
    with pytest.raises(ConfigError, match=r"--tolerance: expected at least [\d.e-]+ dB, which is"):
        run_command(["bake", str(scene), "--out", str(out), "--tolerance", "0.0000001dB"])
    assert sorted(tmp_path.iterdir()) == [scene]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--tolerance", "0.0000000001dB"),
            r"--tolerance: expected at least [\d.e-]+ dB, which is",
        ),
        (("--budget", "1ms"), r"--budget: expected at least [\d.]+ s and [\d.]+ GB, which are"),
        (("--budget", "3MB"), r"--budget: expected at least .* possible, got 0.003 GB"),
    ],
)
def test_generate_says_what_is_possible(
    options: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    photo = tmp_path / "photo.png"
    write_png(torch.rand(64, 64, 3), photo)
    with pytest.raises(ConfigError, match=message) as refused:
        run_command(["generate", str(photo), "--out", str(tmp_path / "out"), *options])
    assert "\n" not in str(refused.value)
    assert sorted(tmp_path.iterdir()) == [photo]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"diff4splat": "0.0.1"}, "expected a calibration of diff4splat .*, got one of 0.0.1"),
        ({"format": "diff4splat calibration 1"}, "expected format"),
        ({"speed_s": 1e3}, "expected a machine at most 8 times as fast or slow as .* report calib"),
    ],
)
def test_a_table_of_another_version_or_machine_is_refused(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    photo, file = tmp_path / "photo.png", tmp_path / "table.json"
    write_png(torch.rand(64, 64, 3), photo)
    write_table(find_table(), file)
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))
    limits = ("--budget", "1h", "--calibration", str(file))
    with pytest.raises(Diff4SplatError, match=message) as refused:
        run_command(["generate", str(photo), "--out", str(tmp_path / "out"), *limits])
    assert "\n" not in str(refused.value)
    assert sorted(tmp_path.iterdir()) == [photo, file]


def test_a_forecast_takes_the_options_of_another_command() -> None:
    parsed = parse(["forecast", "generate", "x.jpg", "--resolution", "64"])
    assert parsed.command == ("generate", "x.jpg", "--resolution", "64")
    named = parse(["forecast", "--calibration", "t.json", "bake", "x"])
    assert (named.calibration, named.command) == (Path("t.json"), ("bake", "x"))


@pytest.mark.parametrize("arguments", [[], ["eval"], ["rendered"], ["export", "ply"]])
def test_commands_without_a_forecast(arguments: list[str]) -> None:
    with pytest.raises(Diff4SplatError, match="forecast: expected one of generate"):
        command_work(arguments)


@pytest.mark.parametrize("content", [b"", b"\xff" * 64, b"\x08" + b"\0" * 7 + b"[1, 2, 3]"])
def test_headers_that_are_none_count_nothing(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "scene.safetensors"
    file.write_bytes(content)
    assert read_scene_header(file) == SceneHeader()


def test_footprints_grow_with_a_smaller_cutoff() -> None:
    assert reach(1 / 255) == 1
    assert reach(1 / 16) < 1 < reach(1 / 4096)

"""``diff4splat convert`` to and from files of one moment, each compared before it appears."""

import re
from pathlib import Path

import pytest
import torch
from filmed_scenes import filmed_scene

from diff4splat.cli.main import run
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.io.splats.suffixes import SPLAT_SUFFIXES
from diff4splat.outputs import splat_export
from diff4splat.outputs.export_check import CheckRow, ExportCheck


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene that moves."""
    file = tmp_path_factory.mktemp("scene") / "scene.safetensors"
    save_scene(filmed_scene(3), file)
    return file


def test_the_suffixes_are_those_of_the_formats() -> None:
    assert set(SPLAT_SUFFIXES) == set(SPLAT_FORMATS)


@pytest.mark.parametrize("suffix", SPLAT_SUFFIXES)
def test_there_and_back(
    scene_file: Path, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, again = tmp_path / f"a{suffix}", tmp_path / "again.safetensors"
    assert run(["convert", str(scene_file), "--out", str(out), "--time", "0.1"]) == 0
    said = capsys.readouterr().err
    found = re.search(r"read again by diff4splat and rendered: ([\d.]+) dB", said)
    assert float(found[1]) >= SPLAT_FORMATS[suffix].least_psnr_db
    assert "motion is left out" in said
    assert run(["convert", str(out), "-o", str(again)]) == 0
    scene, back = load_scene(scene_file), load_scene(again)
    assert len(back.gaussians) == len(scene.gaussians)
    torch.testing.assert_close(back.gaussians.means, scene.state_at(0.1).means, atol=1e-4, rtol=0)
    page = tmp_path / "a.html"
    assert run(["export", "html", str(out), "-o", str(page)]) == 0
    assert page.stat().st_size > 10_000


def test_a_file_that_shows_something_else_never_appears(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    rows = (CheckRow(frame=0, time_s=0.0, psnr_db=37.0),)
    low = ExportCheck(reader="a test", floor_db=38.0, rows=rows)
    monkeypatch.setattr(splat_export, "check_states", lambda *_: low)
    assert run(["convert", str(scene_file), "--out", str(tmp_path / "a.spz")]) == 2
    assert "at least 38 dB, got 37.0 dB" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SPLAT_SUFFIXES)
def test_no_gaussians_and_no_numbers_are_refused_by_name(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").write_bytes(b"solid mesh")
    assert run(["convert", str(tmp_path / f"a{suffix}"), "-o", str(tmp_path / "b.ply")]) == 2
    assert not (tmp_path / "b.ply").exists()

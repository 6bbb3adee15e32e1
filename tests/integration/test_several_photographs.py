"""Several photographs at once, short options, devices and PLY files of ``diff4splat generate``."""

import json
from pathlib import Path

import pytest
import torch

from diff4splat.cli.common.several_inputs import folder_names, photo_files
from diff4splat.cli.main import run
from diff4splat.errors import ConfigError, InputError
from diff4splat.io.photos.images import write_png
from diff4splat.io.ply.ply_file import read_ply
from diff4splat.io.scene_files.scene_file import load_scene

QUICK = ("--model", "test", "--frames", "2", "--steps", "1", "--video", "gif")


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    folder = tmp_path / "photos"
    for name in ("a", "b"):
        write_png(torch.rand(32, 32, 3), folder / f"{name}.png")
    return folder


def test_each_photo_has_its_folder_and_one_failure_stops_no_other(
    photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    (photos / "aa.jpg").write_text("no photo")
    (photos / "notes.txt").write_text("not looked at")
    out = tmp_path / "out"
    assert run(["generate", str(photos), "-o", str(out), *QUICK]) == 2
    shown = capsys.readouterr().err
    assert "photo 2 of 3" in shown
    last = shown.splitlines()[-1]
    assert "got 1 that failed: aa.jpg" in last
    assert {folder.name for folder in out.iterdir()} == {"a", "b"}
    for name in ("a", "b"):
        assert (out / name / "video.gif").is_file()
        card = json.loads((out / name / "card.json").read_text())
        assert card["inputs"]["image"].endswith(f"{name}.png")
        assert "images" not in card["inputs"]


def test_several_files_and_all_well(photos: Path, tmp_path: Path) -> None:
    files = [str(photos / name) for name in ("b.png", "a.png")]
    assert run(["generate", *files, "--out", str(tmp_path / "out"), *QUICK, "--skip-depth"]) == 0
    assert {folder.name for folder in (tmp_path / "out").iterdir()} == {"a", "b"}


def test_one_photo_needs_no_folder_of_its_own_and_may_be_a_ply(
    photos: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    options = ["--ply", "--device", "cpu", *QUICK]
    assert run(["generate", str(photos / "a.png"), "-o", str(out), *options]) == 0
    scene = load_scene(out / "scene.safetensors")
    assert len(read_ply(out / "scene.ply")) == len(scene.gaussians)
    assert run(["generate", str(photos / "a.png"), "-o", str(out), *QUICK]) == 0
    assert not (out / "scene.ply").exists(), "an older run's PLY is not this run's"


@pytest.mark.parametrize("device", ["gpu", "meta", "cuda:99", "", "cpu:0:1"])
def test_a_device_that_is_not_there_is_refused(
    device: str, photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    arguments = ["generate", str(photos / "a.png"), "-o", str(tmp_path / "out"), *QUICK]
    assert run([*arguments, "--device", device]) == 2
    assert "--device: expected" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_photos_that_are_none(tmp_path: Path, photos: Path) -> None:
    with pytest.raises(ConfigError, match="expected a photo or a folder"):
        photo_files(())
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="got none in this folder"):
        photo_files((tmp_path / "empty",))
    with pytest.raises(ConfigError, match="each photo once"):
        photo_files((photos, photos / "a.png"))
    absent = tmp_path / "absent.png"
    assert photo_files((absent,)) == [absent], "its reader says what is wrong"


def test_photos_of_one_name_have_folders_of_their_own() -> None:
    photos = [Path(name) for name in ("x/a.png", "y/A.jpg", "a-2.png", "b.png")]
    assert list(folder_names(photos).values()) == ["a", "A-2", "a-2-2", "b"]

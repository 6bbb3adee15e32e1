"""``diff4splat pack``, and what other commands make of a packed model."""

import json
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, packed_folder, ship, trained_folder
from training_commands import refusal

from diff4splat.cli.main import run
from diff4splat.io.photos.images import write_png
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.hub.model import load_model
from diff4splat.models.hub.weight_files import part_file, weights_sha256
from diff4splat.models.networks import model_parts

PARTS = model_parts(tiny_size())
STATED = ("--license", "Apache-2.0", "--origin", "made by a test")


def packing(folder: Path, out: Path, *more: str) -> int:
    return run(["pack", str(folder), "--out", str(out), *more])


def rows(shown: str) -> dict[str, list[str]]:
    return {line.split()[0]: line.split()[1:] for line in shown.splitlines()}


def test_a_trained_model_is_packed_and_its_sizes_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "packed"
    assert packing(trained_folder(tmp_path / "model"), out, *STATED) == 0
    shown = rows(capsys.readouterr().out)
    assert set(shown) == {*TRAINED, "total", "weights_sha256"}
    sizes = {part: part_file(out, part).stat().st_size for part in TRAINED}
    for part, size in sizes.items():
        assert shown[part] == [f"{size / 1e6:.3f}", "MB"]
    assert float(shown["total"][0]) == pytest.approx(sum(sizes.values()) / 1e6, abs=1e-3)
    assert shown["weights_sha256"] == [weights_sha256(out)]
    model = load_model(out)
    assert (model.license, model.origin) == ("Apache-2.0", "made by a test")


def test_parts_can_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = trained_folder(tmp_path / "model", ())
    assert packing(model, tmp_path / "packed") == 2
    assert "name the parts" in refusal(capsys)
    (model / "head.safetensors").write_bytes(b"x")
    assert packing(model, tmp_path / "packed", "--parts", "vae", "head") == 2
    assert "part 'head': expected weights" in refusal(capsys)
    assert packing(model, tmp_path / "packed", "--parts", "vae", "ldrm") == 0
    assert load_model(tmp_path / "packed").trained == {"vae", "ldrm"}
    assert load_model(tmp_path / "packed").license == "not stated"


def test_what_cannot_be_packed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = trained_folder(tmp_path / "model")
    before = {file.name: file.read_bytes() for file in model.iterdir()}
    assert packing(tmp_path / "nowhere", tmp_path / "out") == 2
    assert "expected a model folder, got none" in refusal(capsys)
    assert packing(model, model) == 2
    assert "another place than the input" in refusal(capsys)
    assert packing(model, tmp_path / "out", "--origin", "two\nlines") == 2
    assert "--origin: expected one line" in refusal(capsys)
    (tmp_path / "file").write_text("")
    assert packing(model, tmp_path / "file") == 2
    assert "a file stands where a folder is needed" in refusal(capsys)
    assert {file.name: file.read_bytes() for file in model.iterdir()} == before
    assert not (tmp_path / "out").exists()


def test_inspect_shows_what_is_trained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = ship(tmp_path, monkeypatch)
    assert run(["inspect", "--model", "test"]) == 0
    shown = rows(capsys.readouterr().out)
    states = {part: shown[part][-1] for part in PARTS}
    assert states == {part: "trained" if part in TRAINED else "random" for part in PARTS}
    assert not shown.keys() & {"monocular_depth", "motion_unet"}
    assert shown["weights"] == [str(folder)]
    assert shown["weights_sha256"] == [weights_sha256(folder)]
    assert (shown["license"], shown["origin"]) == (["MIT"], ["made", "by", "a", "test"])


def test_inspect_of_random_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("diff4splat.models.hub.bundled_weights.WEIGHTS_FOLDER", tmp_path)
    assert run(["inspect", "--model", "test"]) == 0
    shown = rows(capsys.readouterr().out)
    assert {shown[part][-1] for part in PARTS} == {"random"}
    assert shown["weights_sha256"] == ["none"]


def test_inspect_wants_one_thing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for more in ((), ("--model", "test", "--config", "test")):
        assert run(["inspect", *more]) == 2
        assert "expected one of a scene file, --config NAME and --model NAME" in refusal(capsys)
    folder = packed_folder(tmp_path)
    part_file(folder, "vae").write_bytes(b"")
    assert run(["inspect", "--model", str(folder)]) == 2
    assert "the file is damaged, fetch the model again" in refusal(capsys)


@pytest.mark.slow
def test_a_scene_of_bundled_weights_without_a_video_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(tmp_path, monkeypatch)
    write_png(torch.rand(40, 40, 3), tmp_path / "photo.png")
    made = ["generate", str(tmp_path / "photo.png"), "--model", "test", "--frames", "2"]
    assert run([*made, "--out", str(tmp_path / "out"), "--prompt", "waves"]) == 0
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["untrained"] is False, "no network ran"
    assert card["scene"]["moving_gaussians"] == 0
    skipped = {entry["what"]: entry["why"] for entry in card["left_out"]}
    for part in ("vae", "dit", "ldrm", "deformation"):
        assert skipped[part] == "the video model is not trained"
    assert skipped["text_encoder"] == "no network that runs takes text"

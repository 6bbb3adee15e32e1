"""``diff4splat generate --depth``: networks and maps on the command line, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
import small_onnx
import torch
from PIL import Image

from diff4splat.cli.main import run
from diff4splat.io.exr import read_depth_exr
from diff4splat.io.photos.images import write_png

QUICK = ("--model", "small", "--resolution", "64", "--frames", "2", "--video", "webm")


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    y, x = torch.meshgrid(torch.linspace(0, 6, 64), torch.linspace(0, 9, 64), indexing="ij")
    file = tmp_path_factory.mktemp("photo") / "photo.png"
    write_png(torch.stack([x / 9, (x + y).cos() * 0.4 + 0.5, y / 6], -1), file)
    return file


def generated(photo: Path, out: Path, *more: str) -> dict:
    assert run(["generate", str(photo), "--out", str(out), *QUICK, *more]) == 0
    return json.loads((out / "card.json").read_text())


def test_a_map_decides_the_depth_of_the_scene(photo: Path, tmp_path: Path) -> None:
    truth = np.linspace(2, 6, 64, dtype=np.float32)[:, None].repeat(64, 1)
    np.save(tmp_path / "d.npy", truth)
    card = generated(
        photo, tmp_path / "out", "--depth", str(tmp_path / "d.npy"), "--depth-kind", "metric"
    )
    depth = read_depth_exr(tmp_path / "out" / "depth.exr")[0][0].numpy()
    np.testing.assert_allclose(depth[4:-4, 4:-4], truth[4:-4, 4:-4], rtol=0.05)
    assert card["depth"]["kind"] == "metric" and card["depth"]["source"] == "map"
    assert card["depth"]["metres_per_unit"] == pytest.approx(1, rel=0.02)
    left_out = {entry["what"]: entry for entry in card["left_out"]}
    assert left_out["monocular_depth"]["why"] == "depth is given"
    assert left_out["monocular_depth"]["error"] is None
    assert "monocular_depth" not in card["networks_run"]


@pytest.mark.slow
def test_a_network_decides_it_too_and_fills_by_video(photo: Path, tmp_path: Path) -> None:
    graph = small_onnx.one_map(tmp_path / "any.onnx")
    card = generated(photo, tmp_path / "out", "--depth", str(graph), "--fill", "video")
    assert card["depth"]["family"] == "Depth Anything" and len(card["depth"]["sha256"]) == 64
    assert card["depth"]["kind"] == "inverse" and card["depth"]["offset_by"]
    # LDRM starts from the model's own depth prior, for the frames of the video.
    assert {"dit", "ldrm", "monocular_depth"} <= set(card["networks_run"])


def test_without_it_the_card_says_so_and_how_sure_the_model_is(photo: Path, tmp_path: Path) -> None:
    depth = generated(photo, tmp_path / "out")["depth"]
    assert depth.pop("source") == "model"
    assert set(depth) == {"out_of_domain", "median_uncertainty"}
    assert 0 <= depth["out_of_domain"] <= 1 and 0 < depth["median_uncertainty"] < 7.4


def refused(photo: Path, capsys: pytest.CaptureFixture, *more: str) -> str:
    out = photo.parent / "refused"
    assert run(["generate", str(photo), "--out", str(out), *QUICK, *more]) == 2
    assert not out.exists()
    return capsys.readouterr().err.splitlines()[-1]


def test_what_is_refused(photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    np.save(tmp_path / "d.npy", np.full((64, 64), 3.0))
    Image.fromarray(np.zeros((64, 64), np.uint16)).save(tmp_path / "d.png")
    array, png = str(tmp_path / "d.npy"), str(tmp_path / "d.png")
    nan = str(small_onnx.constant(tmp_path / "nan.onnx", np.full((1, 9, 9), np.nan)))
    outside = str(small_onnx.with_external_weights(tmp_path / "out.onnx", "/etc/hostname"))
    (tmp_path / "text.onnx").write_text("hello")
    cases = {
        ("--depth", array): "--depth-kind: expected one for d.npy",
        ("--depth", png): "--depth-kind: expected one for d.png",
        ("--depth-kind", "metric"): "expected --depth too",
        ("--depth", array, "--depth-kind", "metric"): "got 3 in every pixel",
        ("--depth", png, "--depth-kind", "millimetres"): "expected known pixels",
        ("--depth", nan): "NaN or infinity",
        ("--depth", outside): "outside of its folder",
        ("--depth", str(tmp_path / "text.onnx")): "ONNX graph",
        ("--depth", str(tmp_path / "absent.onnx")): "no such file",
        ("--depth", "depth-anything-v2-small"): "models get depth-anything-v2-small",
    }
    for arguments, reason in cases.items():
        assert reason in refused(photo, capsys, *arguments), arguments


def test_models_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setenv("DIFF4SPLAT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("DIFF4SPLAT_MIRROR", str(tmp_path / "mirror"))
    assert run(["models", "list"]) == 0
    listed = capsys.readouterr().out
    assert "depth-anything-v2-small" in listed and "CC-BY-NC-4.0" in listed
    assert run(["models", "get", "depth-pro"]) == 2
    assert "--accept-license" in capsys.readouterr().err
    folder = tmp_path / "mirror" / "depth-pro"
    folder.mkdir(parents=True)
    small_onnx.one_map(folder / "model.onnx")
    assert run(["models", "get", "depth-pro", "--accept-license"]) == 0
    graph = Path(capsys.readouterr().out.strip())
    assert graph.read_bytes() == (folder / "model.onnx").read_bytes()
    assert run(["models", "get", "none"]) == 2

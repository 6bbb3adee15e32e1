"""``diff4splat models inpainting`` refuses other files and writes nothing."""

from pathlib import Path

import pytest

from diff4splat.cli.main import run
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, save_model


def model_folder(folder: Path) -> Path:
    save_model(Model(config=tiny_size(), networks=create_networks(tiny_size())), folder)
    return folder


def test_another_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, weights, out = model_folder(tmp_path / "model"), tmp_path / "x.onnx", tmp_path / "out"
    weights.write_bytes(b"no graph")
    assert (
        run(["models", "inpainting", str(weights), "--model", str(model), "--out", str(out)]) == 2
    )
    assert "expected migan_pipeline_v2.onnx of SHA-256" in capsys.readouterr().err
    assert not out.exists()


def test_the_model_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, weights = model_folder(tmp_path / "model"), tmp_path / "x.onnx"
    weights.write_bytes(b"no graph")
    before = {file.name: file.read_bytes() for file in model.iterdir()}
    command = ["models", "inpainting", str(weights), "--model", str(model), "--out", str(model)]
    assert run(command) == 2
    assert capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in model.iterdir()} == before

"""A public model from its folder to a scene, as a user does it."""

import json
from pathlib import Path

import cogvideox_folder
import numpy as np
import pytest
import wan_folder
from imported_cogvideox import cogvideox_source
from imported_models import wan_source
from PIL import Image

from diff4splat.cli.main import run

__all__ = ["cogvideox_source", "wan_source"]
OPTIONS = ("--reconstruction", "test", "--frames", "5", "--size", "32x32")
PROMPTS = ("--prompt", "the red car moves to the left", "--negative-prompt", "blurry")


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    pixels = np.random.default_rng(0).integers(0, 255, (32, 32, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "photo.png")
    return tmp_path / "photo.png"


@pytest.mark.usefixtures("as_shipped")
def test_a_public_model_becomes_a_scene(
    wan_source: Path, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, scene = tmp_path / "model", tmp_path / "scene"
    assert run(["models", "import", str(wan_source), "--out", str(model), *OPTIONS]) == 0
    assert "none unknown, none missing" in capsys.readouterr().out
    asked = ["generate", str(photo), "--model", str(model), "--fill", "video", "--steps", "2"]
    assert run([*asked, *PROMPTS, "--camera", "arc:0.1", "--out", str(scene)]) == 0
    card = json.loads((scene / "card.json").read_text())
    assert set(card["networks_run"]) == {"vae", "text_encoder", "dit", "ldrm", "deformation"}
    assert card["untrained"], "its LDRM is"
    assert (scene / "scene.safetensors").is_file()


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("kind", ["2b", "5b_i2v", "1.5_i2v", "wan i2v", "wan a14b"])
def test_so_do_other_kinds(kind: str, photo: Path, tmp_path: Path) -> None:
    source, model, scene = (tmp_path / name for name in ("source", "model", "scene"))
    if kind.startswith("wan"):
        wan_folder.write_wan(source, kind.removeprefix("wan "))
    else:
        cogvideox_folder.write_cogvideox(source, kind)
    assert run(["models", "import", str(source), "--out", str(model), *OPTIONS]) == 0
    asked = ["generate", str(photo), "--model", str(model), "--fill", "video", "--steps", "2"]
    assert run([*asked, *PROMPTS, "--camera", "arc:0.1", "--out", str(scene)]) == 0
    card = json.loads((scene / "card.json").read_text())
    wanted = {"vae", "text_encoder", "dit", "ldrm", "deformation"}
    assert set(card["networks_run"]) == wanted | ({"image_encoder"} if kind == "wan i2v" else set())


def test_another_architecture_ends_in_one_line(
    wan_source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "model_index.json").write_text('{"_class_name": "LTXPipeline"}')
    for name in ("transformer", "vae", "text_encoder"):
        (source / name).mkdir()
        (source / name / "config.json").write_text("{}")
    assert run(["models", "import", str(source), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "expected the architecture WanPipeline" in error
    assert not (tmp_path / "out").exists()

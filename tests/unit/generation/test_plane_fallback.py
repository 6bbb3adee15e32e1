"""Generation with a trained reconstruction behind a video model that nobody trained."""

from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, as_trained, random_model, trained_folder
from PIL import Image
from torch import nn

from diff4splat.cli.generate import Generate
from diff4splat.errors import InputError
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import pinhole
from diff4splat.models.factory import PARTS
from diff4splat.models.hub.pretrained import BASE_SIDE_PX, Model, find_side_px, load_model
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

EVERYTHING = GenerationSettings(steps=2, min_opacity=0.0)
WHY = "the video model is not trained"


@pytest.fixture
def partly(tmp_path: Path) -> Model:
    return load_model(trained_folder(tmp_path / "model"))


def picture() -> InputImage:
    generator = torch.Generator().manual_seed(3)
    rgb = torch.rand(32, 48, 3, generator=generator)
    return InputImage(rgb=rgb, camera=pinhole(30.0, (32, 48)), focal_source="test")


def generate(
    model: Model, prompt: str | None = None, settings: GenerationSettings = EVERYTHING
) -> tuple[Scene, RunLog]:
    log = RunLog()
    scene = Diff4SplatPipeline(model)(picture(), "arc", prompt, settings=settings, log=log)
    return scene, log


def forbid_networks(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **named: object) -> None:
        raise AssertionError("a network ran")

    for _, part in model.networks.parts():
        for module in part.modules():
            monkeypatch.setattr(module, "forward", refuse)


def assert_equal(left: Scene, right: Scene) -> None:
    for field in fields(Gaussians):
        name = field.name
        assert torch.equal(getattr(left.gaussians, name), getattr(right.gaussians, name)), name


@pytest.mark.parametrize("settings", [EVERYTHING, GenerationSettings(steps=2)])
def test_it_is_bit_for_bit_the_scene_of_a_fresh_model(
    partly: Model, settings: GenerationSettings
) -> None:
    found, _ = generate(partly, settings=settings)
    wanted, _ = generate(random_model(), settings=settings)
    assert_equal(found, wanted)
    assert isinstance(found.motion, StaticMotion)
    assert found.motion.time_range_s == wanted.motion.time_range_s
    assert found.provenance.untrained
    assert found.provenance.weights_sha256 == partly.weights_sha256


def test_no_network_runs_and_the_log_says_so(
    partly: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    forbid_networks(partly, monkeypatch)
    _, log = generate(partly)
    told = {one.what: one for one in log.skipped}
    assert told["video model and reconstruction"].why == WHY
    assert told["video model and reconstruction"].error == 0
    assert "text encoder" not in told
    assert "sample video" not in log.phases.seconds


def test_a_prompt_is_checked_and_reported_as_left_out(
    partly: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    forbid_networks(partly, monkeypatch)
    scene, log = generate(partly, "waves")
    assert {one.what: one.why for one in log.skipped}["text encoder"] == WHY
    assert scene.provenance.prompt == "waves"
    with pytest.raises(InputError, match="prompt"):
        generate(partly, "")


def outputs_of(network: nn.Module) -> list[torch.Tensor]:
    seen: list[torch.Tensor] = []
    network.register_forward_hook(lambda *called: seen.append(called[-1]))
    return seen


@pytest.mark.parametrize("trained", [(), PARTS, (*TRAINED, "dit")])
def test_otherwise_everything_runs(partly: Model, trained: tuple[str, ...]) -> None:
    model = as_trained(partly, *trained)
    seen = outputs_of(model.networks.ldrm)
    scene, log = generate(model)
    assert len(seen) == 1
    assert "video model and reconstruction" not in {one.what for one in log.skipped}
    with pytest.raises(AssertionError):
        assert_equal(scene, generate(random_model())[0])


def test_pictures_are_larger_where_no_network_runs(tmp_path: Path) -> None:
    folder = trained_folder(tmp_path / "partly")
    assert find_side_px(folder) == load_model(folder).side_px == BASE_SIDE_PX
    whole = trained_folder(tmp_path / "whole", PARTS)
    assert find_side_px(whole) == load_model(whole).side_px == max(load_model(whole).config.size_px)
    assert find_side_px("test") == load_model("test").side_px == 32


def test_the_command_reads_pictures_at_that_size(tmp_path: Path) -> None:
    folder, file = trained_folder(tmp_path / "partly"), tmp_path / "photo.png"
    Image.new("RGB", (320, 320), (200, 90, 30)).save(file)
    asked = Generate(image=file, model=str(folder), out=tmp_path / "scene")
    assert max(asked.picture().camera.size_px) == BASE_SIDE_PX
    assert max(replace(asked, resolution=64).picture().camera.size_px) == 64

"""Clips are encoded once, and a video model learns from that beside a model that is trained."""

import json
from pathlib import Path

import pytest
import torch
from packed_models import TRAINED, trained_folder
from training_commands import contents, refusal, rows

from diff4splat.cli.main import run
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.models.hub.model import load_model
from diff4splat.models.networks import model_parts
from diff4splat.training.latents.latent_shards import read_packs

SHORT = ("--set", "stages.video_diffusion.steps=2")


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return trained_folder(tmp_path_factory.mktemp("start"))


def prepare(shards: Path, start: Path, out: Path, *more: str) -> int:
    given = ["--clips", str(shards), "--out", str(out), "--model", str(start), "--config", "test"]
    return run(["prepare", "latents", *given, *more])


@pytest.fixture(scope="module")
def latents(shards: Path, start: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("encoded") / "latents"
    assert prepare(shards, start, out) == 0
    return out


def train(out: Path, latents: Path, *more: str) -> int:
    given = ["--config", "test", "--stage", "video_diffusion", "--out", str(out)]
    return run(["train", *given, "--latents", str(latents), *SHORT, *more])


def test_every_clip_is_encoded_with_its_mirror_image(latents: Path, start: Path) -> None:
    pack = read_packs(latents)
    assert len(pack) == 2 * 8
    assert pack.latent.shape[1:] == (4, 2, 4, 4)
    assert pack.versions == 2
    assert pack.model == load_model(start).weights_sha256()
    assert pack.render_latent is None, "the test size takes no render condition"


def test_a_second_call_leaves_the_files_as_they_are(
    latents: Path, shards: Path, start: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(latents)
    assert prepare(shards, start, latents) == 0
    assert "wrote 0 encoded clips" in capsys.readouterr().err
    assert contents(latents) == before


def test_mirrors_can_be_left_out(
    shards: Path, start: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert prepare(shards, start, tmp_path, "--no-mirror") == 0
    assert "wrote 8 encoded clips" in capsys.readouterr().err
    assert read_packs(tmp_path).versions == 1


def test_the_video_model_learns_from_latents_alone(
    latents: Path, start: Path, tmp_path: Path
) -> None:
    assert train(tmp_path, latents, "--from-model", str(start)) == 0
    result = json.loads((tmp_path / "video_diffusion" / "result.json").read_text())
    assert (result["finished"], result["step"]) == (True, 2)
    assert len(rows(tmp_path / "video_diffusion", "step")) == 2
    assert not (tmp_path / "vae").exists()
    written = json.loads((tmp_path / "video_diffusion" / "recipe.json").read_text())
    (stage,) = [one for one in written["stages"] if one["name"] == "video_diffusion"]
    assert stage["data"]["sources"][0]["folder"] == str(latents)
    whole, given = load_model(tmp_path / "model"), load_model(start)
    assert whole.trained == set(model_parts(whole.config))
    for part in TRAINED:
        theirs = getattr(given.networks, part).state_dict()
        for key, value in getattr(whole.networks, part).state_dict().items():
            assert torch.equal(value, theirs[key]), f"{part}.{key}"


def test_two_folders_are_learnt_from_together(latents: Path, start: Path, tmp_path: Path) -> None:
    both = ("--latents", str(latents), str(latents))
    given = ["--config", "test", "--stage", "video_diffusion", "--out", str(tmp_path), *SHORT]
    assert run(["train", *given, *both, "--from-model", str(start), "--steps", "1"]) == 0


def test_without_a_model_the_stages_before_are_asked_for(
    latents: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(tmp_path, latents) == 2
    assert "train that stage first" in refusal(capsys)


def test_a_folder_without_latents_is_refused(
    shards: Path, start: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(tmp_path, shards, "--from-model", str(start)) == 2
    assert "diff4splat prepare latents" in refusal(capsys)
    assert not (tmp_path / "video_diffusion").exists()


def test_a_model_with_render_conditions_refuses_latents_without(
    latents: Path, start: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rendered = ("--set", "model.dit.render_condition=true")
    assert train(tmp_path, latents, "--from-model", str(start), *rendered) == 2
    assert "render condition" in refusal(capsys)


def test_render_conditions_of_an_earlier_release_are_refused(
    latents: Path, start: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = latents.iterdir()
    tensors = read_tensors(file)
    tensors["draft"] = tensors["latent"]
    old = TensorFile(tensors=tensors, metadata=read_metadata(file))
    write_tensors(old, tmp_path / "old" / file.name)
    assert train(tmp_path / "run", tmp_path / "old", "--from-model", str(start)) == 2
    line = refusal(capsys)
    assert "earlier release" in line and "encode the clips again" in line

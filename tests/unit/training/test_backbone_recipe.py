"""LDRM learns on the latents of an imported model; the public weights stay as they are."""

import json
import statistics
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from imported_cogvideox import cogvideox_source, imported_cogvideox
from imported_models import imported, wan_source
from safetensors.torch import load_file

from diff4splat.configs.public_backbone import backbone_recipe
from diff4splat.models.adapters.tuning import ADDED
from diff4splat.models.hub.folders import find_config
from diff4splat.models.hub.model import load_model
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.train_stage import MODEL_FOLDER, StageRequest, train_stage
from diff4splat.training.trainer.checkpoints.export import load_parts

__all__ = ["cogvideox_source", "imported", "imported_cogvideox", "wan_source"]
STEPS = 60
PUBLIC = ("vae.safetensors", "dit.safetensors", "text_encoder.safetensors", "tokenizer.json")


@pytest.fixture(params=["t2v", "2b"])
def folder(
    request: pytest.FixtureRequest,
    imported: dict[str, Path],
    imported_cogvideox: dict[str, Path],
) -> Path:
    """A model of Wan, and one of CogVideoX."""
    return (imported | imported_cogvideox)[request.param]


def test_reconstruction_trains_on_public_latents(folder: Path, tmp_path: Path) -> None:
    recipe = backbone_recipe(find_config(folder))
    stages = [replace(stage, steps=2, gates=()) for stage in recipe.stages]
    recipe = replace(recipe, stages=tuple(stages))
    start = load_model(folder)
    before = start.networks.ldrm.state_dict()["to_gaussians.weight"].clone()
    result = train_stage(
        StageRequest(recipe=recipe, stage="static-low", folder=tmp_path, start=start)
    )
    assert result.outcome == "finished"
    for name in PUBLIC:
        assert (tmp_path / MODEL_FOLDER / name).read_bytes() == (folder / name).read_bytes()
    model = load_model(tmp_path / MODEL_FOLDER)
    assert model.trained >= {"vae", "dit", "text_encoder"}
    after = model.networks.ldrm.state_dict()["to_gaussians.weight"]
    assert not torch.equal(before, after)


@pytest.mark.slow
def test_the_loss_falls_on_public_latents(folder: Path, tmp_path: Path) -> None:
    recipe = backbone_recipe(find_config(folder))
    stages = [replace(stage, steps=STEPS, gates=()) for stage in recipe.stages]
    request = StageRequest(
        recipe=replace(recipe, stages=tuple(stages)),
        stage="static-low",
        folder=tmp_path,
        start=load_model(folder),
    )
    train_stage(request)
    lines = (tmp_path / "static-low" / "log.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in lines]
    losses = [event["loss/total"] for event in events if event["event"] == "step"]
    first, last = (statistics.fmean(part) for part in (losses[:10], losses[-10:]))
    assert len(losses) == STEPS and last < 0.9 * first, f"{first} to {last}"


def test_only_adapters_of_the_video_model_learn(folder: Path, tmp_path: Path) -> None:
    recipe = backbone_recipe(find_config(folder))
    stages = [replace(stage, steps=2, gates=(), lora_rank=2) for stage in recipe.stages]
    recipe = replace(recipe, stages=tuple(stages))
    start = load_model(folder)
    train_stage(
        StageRequest(
            recipe=recipe,
            stage="video_diffusion",
            folder=tmp_path,
            start=start,
            ignore_gates=True,
        )
    )
    place = tmp_path / "video_diffusion"
    raw, public = (
        load_parts(last_checkpoint(place), "raw")["dit"],
        load_file(folder / "dit.safetensors"),
    )
    learnt = {key for key in raw if ".lora_" in key or key.startswith(ADDED)}
    assert learnt < set(raw)
    for key in set(raw) - learnt:
        assert torch.equal(raw[key], public[key.replace(".base.", ".")]), f"{key} stays"
    assert any(raw[key].any() for key in learnt if key.endswith("lora_up.weight"))
    handed_over = load_model(tmp_path / MODEL_FOLDER, parts=("dit",)).networks.dit.state_dict()
    assert handed_over.keys() == public.keys(), "merged"


@pytest.mark.parametrize("kind", ["t2v", "ti2v"])
def test_every_stage_fits_the_model(imported: dict[str, Path], kind: str) -> None:
    recipe = backbone_recipe(find_config(imported[kind]))
    assert recipe.stages[0].kind == "static"
    assert not any("vae" in stage.trained for stage in recipe.stages)

"""LDRM learns on the latents of an imported model; the public weights stay as they are."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from imported_models import imported, wan_source

from diff4splat.configs.public_backbone import backbone_recipe
from diff4splat.models.hub.folders import find_config
from diff4splat.models.hub.model import load_model
from diff4splat.training.train_stage import MODEL_FOLDER, StageRequest, train_stage

__all__ = ["imported", "wan_source"]
PUBLIC = ("vae.safetensors", "dit.safetensors", "text_encoder.safetensors", "tokenizer.json")


def test_reconstruction_trains_on_public_latents(imported: dict[str, Path], tmp_path: Path) -> None:
    folder = imported["t2v"]
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


@pytest.mark.parametrize("kind", ["t2v", "ti2v"])
def test_every_stage_fits_the_model(imported: dict[str, Path], kind: str) -> None:
    recipe = backbone_recipe(find_config(imported[kind]))
    assert recipe.stages[0].kind == "static"
    assert not any("vae" in stage.trained for stage in recipe.stages)

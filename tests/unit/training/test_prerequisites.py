"""Which stage builds on which, and what it starts with."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import reading, write_shards
from stage_fixtures import SquaredDifference

from diff4splat.configs.recipes import RECIPES, recipe_by_name
from diff4splat.errors import CheckpointError, ConfigError, FileFormatError
from diff4splat.models.config.model import MonocularDepthConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.networks import model_parts
from diff4splat.training.latent_statistics import FILE, read_statistics
from diff4splat.training.prerequisites import (
    continued_stage,
    last_checkpoint,
    require_prerequisites,
    sources_of_parts,
    starting_networks,
    trained_networks,
)
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import Gate, StageRecipe
from diff4splat.training.stages.factory import create_stage
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.train_stage import StageRequest, train_stage
from diff4splat.training.trainer.checkpoints.export import load_parts

BUILDS_ON = {
    "vae": {},
    "static-low": {"vae": "vae"},
    "static-high": {"vae": "vae", "ldrm": "static-low"},
    "dynamic": {"vae": "vae", "ldrm": "static-high"},
    "video_diffusion": {"vae": "vae"},
    "joint": {
        "vae": "vae",
        "ldrm": "dynamic",
        "deformation": "dynamic",
        "text_encoder": "video_diffusion",
        "dit": "video_diffusion",
    },
}
CONTINUES = {"static-high": "static-low", "dynamic": "static-high", "joint": "video_diffusion"}
START = {"monocular_depth": "monocular_depth"}
SMALL_BUILDS_ON = {
    "posed_video_pretrain": START,
    "static-low": START | {"vae": "vae", "ldrm": "posed_video_pretrain"},
    "motion": START | {"vae": "vae", "ldrm": "static-low"},
    "dynamic": START | {"vae": "vae", "ldrm": "static-low", "deformation": "motion"},
    "monocular_depth": {},
    "video_diffusion": {"vae": "vae", "monocular_depth": "monocular_depth"},
    "motion_diffusion": {"text_encoder": "video_diffusion"},
    "object_mask": {"text_encoder": "video_diffusion"},
    "image_classifier": {"text_encoder": "video_diffusion", "object_mask": "object_mask"},
    "object_shadow": {},
    "video_distillation": {
        "vae": "vae",
        "monocular_depth": "monocular_depth",
        "text_encoder": "video_diffusion",
        "dit": "video_diffusion",
    },
}
"""What differs in ``small``: LDRM starts without an autoencoder, on the depth prior's depth."""
SMALL_CONTINUES = {
    "static-low": "posed_video_pretrain",
    "dynamic": "motion",
    "video_distillation": "video_diffusion",
}


@pytest.mark.parametrize(
    ("name", "stage"),
    [(name, stage.name) for name in RECIPES for stage in recipe_by_name(name).stages],
)
def test_parts_come_from_the_last_stage_that_trained_them(name: str, stage: str) -> None:
    recipe = recipe_by_name(name)
    sees = any(other.kind == "posed_video_pretrain" for other in recipe.stages)
    builds_on = BUILDS_ON | (SMALL_BUILDS_ON if sees else {})
    continues = CONTINUES | (SMALL_CONTINUES if sees else {})
    found = sources_of_parts(recipe, recipe.stage(stage))
    assert {part: earlier.name for part, earlier in found.items()} == builds_on[stage]
    before = continued_stage(recipe, recipe.stage(stage), found)
    assert (before and before.name) == continues.get(stage)


def required(recipe: Recipe, stage: str, folder: Path, ignore_gates: bool) -> None:
    sources = sources_of_parts(recipe, recipe.stage(stage))
    require_prerequisites(recipe, sources, folder, ignore_gates)


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recipe, Path]:
    """An autoencoder and a first static stage, of two steps each."""
    shards = write_shards(tmp_path_factory.mktemp("shards"))
    recipe, run = reading(shards), tmp_path_factory.mktemp("run")
    for stage in ("vae", "static-low"):
        train_stage(StageRequest(recipe=recipe, stage=stage, folder=run))
    return recipe, run


@pytest.mark.parametrize("stage", [name for name, parts in BUILDS_ON.items() if parts])
def test_a_stage_before_that_was_not_begun_is_named(stage: str, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    for ignoring in (False, True):
        with pytest.raises(ConfigError, match=r"vae/result.json: .* train that stage first"):
            required(recipe, stage, tmp_path, ignoring)
    required(recipe, "vae", tmp_path, False)


def write_result(folder: Path, **values: object) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    whole = {"stage": folder.name, "finished": True, "step": 2, "checkpoint": "c", "measures": {}}
    (folder / "result.json").write_text(json.dumps(whole | values))


def test_gates_of_all_stages_before_are_looked_at(tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    gate = Gate(measure="psnr", bound=20.0)
    stages = tuple(replace(stage, gates=(gate,)) for stage in recipe.stages)
    recipe = replace(recipe, stages=stages)
    for stage in ("vae", "static-low"):
        write_result(tmp_path / stage, measures={"psnr": 25.0})
    high = "static-high"
    required(recipe, high, tmp_path, False)
    for short in ("vae", "static-low"):
        write_result(tmp_path / short, measures={"psnr": 17.5})
        with pytest.raises(ConfigError, match=rf"{short}: .* at least 20, got 17.5, 2.5 short"):
            required(recipe, high, tmp_path, False)
        required(recipe, high, tmp_path, True)
        write_result(tmp_path / short, measures={"psnr": 25.0})
    write_result(tmp_path / "static-low", finished=False, step=1)
    with pytest.raises(ConfigError, match=r"static-low: expected 100 steps .* got 1; .*ignore"):
        required(recipe, high, tmp_path, False)
    # Another branch is not asked for.
    required(recipe, "video_diffusion", tmp_path, False)


def test_stages_start_with_averaged_weights(begun: tuple[Recipe, Path]) -> None:
    recipe, run = begun
    networks = starting_networks(recipe, recipe.stage("static-high"), run)
    for part, stage in (("vae", "vae"), ("ldrm", "static-low")):
        checkpoint = last_checkpoint(run / stage)
        averaged, raw = (load_parts(checkpoint, kind)[part] for kind in ("averaged", "raw"))
        found = getattr(networks, part).state_dict()
        assert any(not torch.equal(averaged[key], raw[key]) for key in averaged)
        for key, value in averaged.items():
            if "latent" not in key:  # the statistics are set afterwards
                assert torch.equal(found[key], value), key
    mean, std = read_statistics(run / "vae")
    stored = dict(networks.vae.named_buffers())
    assert any(torch.equal(buffer.flatten(), mean) for buffer in stored.values())
    assert any(torch.equal(buffer.flatten(), std) for buffer in stored.values())


def test_parts_that_do_not_run_are_not_built(begun: tuple[Recipe, Path]) -> None:
    recipe, run = begun
    networks = starting_networks(recipe, recipe.stage("static-high"), run)
    assert [name for name, _ in networks.parts()] == ["vae", "ldrm"]


def with_depth_prior(recipe: Recipe, rendered: bool, channels: int) -> Recipe:
    model = recipe.model
    model = replace(
        model,
        dit=replace(model.dit, render_condition=rendered),
        monocular_depth=MonocularDepthConfig(channels=channels),
    )
    return replace(recipe, model=model)


@pytest.mark.parametrize("stage", recipe_by_name("test").stages, ids=lambda stage: stage.name)
@pytest.mark.parametrize(("rendered", "channels"), [(False, 0), (False, 4), (True, 0), (True, 4)])
def test_stages_have_a_depth_prior_where_they_render_with_one(
    stage: StageRecipe, rendered: bool, channels: int, tmp_path: Path
) -> None:
    recipe = with_depth_prior(recipe_by_name("test"), rendered, channels)
    vae = recipe.stages[0]
    alone = replace(recipe, stages=(vae,) if stage.kind == "vae" else (stage,))
    networks = starting_networks(alone, stage, tmp_path)
    renders = rendered and channels > 0 and stage.kind in ("video_diffusion", "joint")
    assert (networks.monocular_depth is not None) == renders
    plan = StagePlan(model=recipe.model, recipe=stage, seed=0, features=SquaredDifference())
    created = create_stage(networks, plan)
    frozen = [one for key, one in created.named_parameters() if key.startswith("monocular_depth")]
    assert bool(frozen) == renders and not any(one.requires_grad for one in frozen)


def test_parts_nobody_trained_are_the_recipes_random_ones(begun: tuple[Recipe, Path]) -> None:
    recipe, run = begun
    networks, done = trained_networks(recipe, run)
    assert done == {"vae", "ldrm"}
    random = create_networks(recipe.model, seed=recipe.seed)
    assert [name for name, _ in networks.parts()] == list(model_parts(recipe.model))
    for part in set(model_parts(recipe.model)) - done:
        wanted = getattr(random, part).state_dict()
        for key, value in getattr(networks, part).state_dict().items():
            assert torch.equal(value, wanted[key]), key


def test_an_unfinished_stage_hands_on_its_averages_but_counts_as_untrained(
    begun: tuple[Recipe, Path], tmp_path: Path
) -> None:
    recipe, run = begun
    for stage in ("vae", "static-low"):
        (tmp_path / stage).symlink_to(run / stage)
    train_stage(
        StageRequest(
            recipe=recipe,
            stage="static-high",
            folder=tmp_path,
            stop_after_steps=1,
            ignore_gates=True,
        )
    )
    networks, done = trained_networks(recipe, tmp_path)
    assert done == {"vae", "ldrm"}  # the lower stage is over
    newest = load_parts(last_checkpoint(tmp_path / "static-high"))["ldrm"]
    for key, value in networks.ldrm.state_dict().items():
        assert torch.equal(value, newest[key]), key


def test_another_model_than_the_runs_is_refused(begun: tuple[Recipe, Path]) -> None:
    recipe, run = begun
    vae = replace(recipe.model.vae, latent_channels=recipe.model.vae.latent_channels + 1)
    other = replace(recipe, model=replace(recipe.model, vae=vae))
    with pytest.raises(CheckpointError, match=r"vae: expected the weights of the recipe's model"):
        starting_networks(other, other.stage("static-low"), run)


def damaged(run: Path, folder: Path) -> Path:
    """A copy of the autoencoder's stage."""
    shutil.copytree(run / "vae", folder / "vae")
    return folder / "vae"


def test_missing_statistics_say_what_to_do(begun: tuple[Recipe, Path], tmp_path: Path) -> None:
    recipe, run = begun
    (damaged(run, tmp_path) / FILE).unlink()
    with pytest.raises(CheckpointError, match=r"expected the statistics of the latents, got none"):
        starting_networks(recipe, recipe.stage("static-low"), tmp_path)


def test_damaged_checkpoints_and_statistics_are_named(
    begun: tuple[Recipe, Path], tmp_path: Path
) -> None:
    recipe, run = begun
    stage, low = damaged(run, tmp_path), recipe.stage("static-low")
    whole = (stage / FILE).read_bytes()
    (stage / FILE).write_bytes(whole[:-4])
    with pytest.raises(FileFormatError, match=FILE):
        starting_networks(recipe, low, tmp_path)
    (stage / FILE).write_bytes(whole)
    (weights,) = last_checkpoint(stage).glob("*.safetensors")
    content = bytearray(weights.read_bytes())
    content[-100] ^= 0x10
    weights.write_bytes(content)
    with pytest.raises(FileFormatError, match="window-000-step-00000002"):
        starting_networks(recipe, low, tmp_path)
    weights.unlink()
    with pytest.raises(FileFormatError, match="window-000-step-00000002"):
        starting_networks(recipe, low, tmp_path)

"""Runs that begin with parts of another model."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import reading, write_shards
from packed_models import TRAINED, as_trained, trained_folder
from torch import nn

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import CheckpointError, ConfigError
from diff4splat.models.config.model import MonocularDepthConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.networks import model_parts
from diff4splat.training.prerequisites import (
    continued_stage,
    last_checkpoint,
    require_prerequisites,
    sources_of_parts,
    stages_before,
    starting_networks,
    trained_networks,
)
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.train_stage import MODEL_FOLDER, StageRequest, train_stage
from diff4splat.training.trainer.checkpoints.export import load_parts


def same(network: nn.Module, other: nn.Module) -> bool:
    theirs = other.state_dict()
    return all(torch.equal(value, theirs[key]) for key, value in network.state_dict().items())


def names(recipe: Recipe, stage: str, run: Path, start: Model | None) -> dict[str, str]:
    found = stages_before(recipe, recipe.stage(stage), run, start)
    return {part: earlier.name for part, earlier in found.items()}


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A model that reconstructs."""
    return load_model(trained_folder(tmp_path_factory.mktemp("start")))


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recipe, Path]:
    """An autoencoder of two steps."""
    recipe = reading(write_shards(tmp_path_factory.mktemp("shards")))
    run = tmp_path_factory.mktemp("run")
    train_stage(StageRequest(recipe=recipe, stage="vae", folder=run))
    return recipe, run


@pytest.mark.parametrize("stage", ["vae", "static-low", "dynamic", "video_diffusion", "joint"])
def test_without_a_model_every_part_comes_from_its_stage(stage: str, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    wanted = sources_of_parts(recipe, recipe.stage(stage))
    assert stages_before(recipe, recipe.stage(stage), tmp_path) == wanted


def test_parts_that_are_trained_ask_for_no_stage(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    assert names(recipe, "dynamic", tmp_path, start) == {}
    assert names(recipe, "video_diffusion", tmp_path, start) == {}
    rest = {"text_encoder": "video_diffusion", "dit": "video_diffusion"}
    assert names(recipe, "joint", tmp_path, start) == rest
    sources = stages_before(recipe, recipe.stage("dynamic"), tmp_path, start)
    require_prerequisites(recipe, sources, tmp_path, False)
    assert continued_stage(recipe, recipe.stage("dynamic"), sources) is None


def test_parts_that_are_not_trained_still_ask_for_their_stage(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    half = as_trained(start, "vae")
    assert names(recipe, "dynamic", tmp_path, half) == {"ldrm": "static-high"}
    sources = stages_before(recipe, recipe.stage("dynamic"), tmp_path, half)
    with pytest.raises(ConfigError, match=r"static-high/result.json: .* train that stage first"):
        require_prerequisites(recipe, sources, tmp_path, False)
    # Nobody can go on from a model without a stage, but from the stage that is left.
    assert continued_stage(recipe, recipe.stage("dynamic"), sources).name == "static-high"


def test_stages_that_were_begun_come_before_the_model(
    begun: tuple[Recipe, Path], start: Model
) -> None:
    recipe, run = begun
    assert names(recipe, "static-low", run, start) == {"vae": "vae"}
    assert names(recipe, "dynamic", run, start) == {"vae": "vae"}


def test_a_stage_starts_with_the_models_trained_parts(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    networks = starting_networks(recipe, recipe.stage("dynamic"), tmp_path, start)
    for part in TRAINED:
        assert same(getattr(networks, part), getattr(start.networks, part)), part
    assert {name for name, _ in networks.parts()} == {"vae", "ldrm", "deformation"}


def test_parts_that_the_model_has_not_trained_are_the_recipes_random_ones(
    start: Model, tmp_path: Path
) -> None:
    recipe = recipe_by_name("test")
    half = as_trained(start, "vae")
    networks = starting_networks(recipe, recipe.stage("static-low"), tmp_path, half)
    random = create_networks(recipe.model, seed=recipe.seed)
    assert same(networks.vae, start.networks.vae)
    assert same(networks.ldrm, random.ldrm) and not same(networks.ldrm, start.networks.ldrm)


def test_what_the_run_has_trained_replaces_the_models(
    begun: tuple[Recipe, Path], start: Model
) -> None:
    recipe, run = begun
    networks = starting_networks(recipe, recipe.stage("static-low"), run, start)
    averaged = load_parts(last_checkpoint(run / "vae"))["vae"]
    found = networks.vae.state_dict()
    assert all(torch.equal(found[key], averaged[key]) for key in averaged if "latent" not in key)
    assert same(networks.ldrm, start.networks.ldrm)


def test_the_model_itself_stays_as_it_is(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    networks = starting_networks(recipe, recipe.stage("dynamic"), tmp_path, start)
    before = next(start.networks.ldrm.parameters()).detach().clone()
    with torch.no_grad():
        next(networks.ldrm.parameters()).add_(1.0)
    assert torch.equal(next(start.networks.ldrm.parameters()), before)


def test_trained_parts_are_those_of_the_run_and_of_the_model(
    begun: tuple[Recipe, Path], start: Model, tmp_path: Path
) -> None:
    recipe, run = begun
    networks, done = trained_networks(recipe, tmp_path, start)
    assert done == frozenset(TRAINED) and same(networks.vae, start.networks.vae)
    networks, done = trained_networks(recipe, run, as_trained(start, "ldrm"))
    assert done == {"vae", "ldrm"} and same(networks.ldrm, start.networks.ldrm)
    assert not same(networks.vae, start.networks.vae)
    random = create_networks(recipe.model, seed=recipe.seed)
    for part in set(model_parts(recipe.model)) - done:
        assert same(getattr(networks, part), getattr(random, part)), part


def test_priors_that_the_recipes_model_lacks_are_left_out(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    config = replace(start.config, monocular_depth=MonocularDepthConfig(channels=4))
    prior = create_networks(config, parts=("monocular_depth",)).monocular_depth
    networks = replace(start.networks, monocular_depth=prior)
    rich = replace(start, config=config, networks=networks)
    rich = as_trained(rich, *TRAINED, "monocular_depth")
    networks, done = trained_networks(recipe, tmp_path, rich)
    assert networks.monocular_depth is None and same(networks.ldrm, start.networks.ldrm)
    assert done == set(TRAINED)
    recipe = replace(recipe, model=config)
    networks, done = trained_networks(recipe, tmp_path, rich)
    assert same(networks.monocular_depth, prior) and "monocular_depth" in done


def test_a_part_that_an_unfinished_stage_trains_is_not_done(
    begun: tuple[Recipe, Path], start: Model, tmp_path: Path
) -> None:
    recipe, run = begun
    shutil.copytree(run / "vae", tmp_path / "vae")
    file = tmp_path / "vae" / "result.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"finished": False}))
    networks, done = trained_networks(recipe, tmp_path, start)
    assert done == {"ldrm", "deformation"}
    assert not same(networks.vae, start.networks.vae)


def test_a_model_of_another_size_is_refused(start: Model, tmp_path: Path) -> None:
    recipe = recipe_by_name("test")
    vae = replace(recipe.model.vae, latent_channels=recipe.model.vae.latent_channels + 1)
    other = replace(recipe, model=replace(recipe.model, vae=vae))
    with pytest.raises(CheckpointError, match=r"(vae|ldrm): expected the weights of the recipe"):
        starting_networks(other, other.stage("static-low"), tmp_path, start)
    with pytest.raises(CheckpointError, match="expected the weights of the recipe's model"):
        trained_networks(other, tmp_path, start)


def test_a_stage_is_trained_with_nothing_but_the_model_before_it(
    begun: tuple[Recipe, Path], start: Model, tmp_path: Path
) -> None:
    recipe, _ = begun
    with pytest.raises(ConfigError, match="train that stage first"):
        train_stage(StageRequest(recipe=recipe, stage="static-low", folder=tmp_path))
    given = as_trained(start, "vae")
    asked = StageRequest(recipe=recipe, stage="static-low", folder=tmp_path, start=given)
    assert train_stage(asked).outcome == "finished"
    whole = load_model(tmp_path / MODEL_FOLDER)
    assert whole.trained == {"vae", "ldrm"}
    assert same(whole.networks.vae, start.networks.vae)
    averaged = load_parts(last_checkpoint(tmp_path / "static-low"))["ldrm"]
    found = whole.networks.ldrm.state_dict()
    assert all(torch.equal(found[key], value) for key, value in averaged.items())

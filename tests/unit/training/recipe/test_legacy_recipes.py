"""Recipes of the first release: they load, mean the same, and their runs go on."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import write_shards
from stage_fixtures import SquaredDifference, make_batch, make_stage, shake_heads

from diff4splat.configs.recipes import recipe_by_name, with_clips
from diff4splat.errors import CheckpointError, ConfigError
from diff4splat.metrics.features.load import load_features
from diff4splat.models.config.model import ImageInpaintingConfig, ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.training.earlier_release import earlier_fingerprint
from diff4splat.training.recipe.fingerprint import fingerprint, fingerprint_of
from diff4splat.training.recipe.kinds import REQUEST_KINDS, SHADOW_KINDS
from diff4splat.training.recipe.legacy import (
    DATA_KEYS,
    KINDS,
    LOSS_DEFAULTS,
    LOSS_KEYS,
    REMOVED_KINDS,
    STAGE_KEYS,
)
from diff4splat.training.recipe.recipe_json import recipe_from_json, recipe_to_json
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.factory import STAGES, create_stage
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.train_stage import RECIPE_FILE, StageRequest, train_stage
from diff4splat.training.trainer.checkpoints.files import STATE_FILE

GOLDEN = Path(__file__).parents[3] / "golden"
TEST, SMALL = (GOLDEN / f"recipe_v1_{name}.json" for name in ("test", "small"))
NAMES = {
    "sight": "posed_video_pretrain",
    "depth": "monocular_depth",
    "generator": "video_diffusion",
    "branch": "motion_diffusion",
}
UNUSED = {"use_ground_truth_frames": False, "single_image_probability": 0.0}
"""Set in the first release's depth stage, which does not use them."""
FINGERPRINTS = {
    "vae": "7de76992c62f",
    "static-low": "eba22e7c73ea",
    "static-high": "140c303357a2",
    "dynamic": "131ca17cae0a",
    "generator": "1b7eab498f0a",
    "joint": "7aadaa7ad41c",
}
"""As the first release printed them."""
STAGES_OF_SMALL = (
    "vae",
    "sight",
    "static-low",
    "motion",
    "dynamic",
    "single",
    "depth",
    "generator",
    "branch",
)


def since(old: ModelConfig, new: ModelConfig) -> ModelConfig:
    """Sets what the first release did not know and this one sets for ``small``."""
    assert old.monocular_depth.photo_scale == old.motion_unet.input_scale == 1
    prior = replace(
        old.monocular_depth,
        photo_scale=2,
        image_backbone=True,
        backbone_size="lite2",
        uncertainty=True,
    )
    return replace(
        old,
        monocular_depth=prior,
        motion_unet=replace(old.motion_unet, input_scale=2),
        object_mask=new.object_mask,
        image_inpainting=new.image_inpainting,
        object_shadow=new.object_shadow,
        refinement=replace(old.refinement, depth_prior=True),
        default_guidance=new.default_guidance,
    )


def test_the_test_recipe_loads_as_the_one_of_this_release() -> None:
    old, new = recipe_from_json(TEST.read_text()), recipe_by_name("test")
    assert [stage.name for stage in old.stages] == list(FINGERPRINTS)
    named = [replace(stage, name=NAMES.get(stage.name, stage.name)) for stage in old.stages]
    assert replace(old, stages=tuple(named)) == new


def test_every_stage_of_the_small_recipe_loads_as_the_one_of_this_release() -> None:
    old, new = recipe_from_json(SMALL.read_text()), recipe_by_name("small")
    later = (*REQUEST_KINDS, *SHADOW_KINDS)
    known = [stage for stage in new.stages if stage.kind not in later]
    for stage in known:
        names = {after: before for before, after in NAMES.items()}
        found = replace(old.stage(names.get(stage.name, stage.name)), name=stage.name)
        if stage.kind == "monocular_depth":
            # Its network had no image backbone yet, and no uncertainty.
            assert not found.public_backbone and not found.optimizer.part_rates
            assert found.losses.uncertainty == 0
            found = replace(found, losses=replace(found.losses, uncertainty=1.0))
            found = replace(found, optimizer=stage.optimizer, public_backbone=True, **UNUSED)
        if stage.kind == "video_diffusion":
            # The first release weighed hidden cells like all others.
            assert found.losses.hidden_weight == 1
            found = replace(found, losses=replace(found.losses, hidden_weight=8.0))
        if stage.kind == "motion_diffusion":
            # Nor did it compare sentences of one meaning.
            assert found.losses.paraphrase == 0
            found = replace(found, losses=replace(found.losses, paraphrase=1.0))
        assert found == stage
    assert (since(old.model, new.model), old.trainer, old.seed) == (
        new.model,
        new.trainer,
        new.seed,
    )


@pytest.mark.parametrize("name", ["told", "joint"])
def test_stages_of_removed_kinds_are_refused_by_name(name: str) -> None:
    old = recipe_from_json(SMALL.read_text())
    assert name in old.removed_stages
    with pytest.raises(ConfigError, match=rf"got '{name}', whose kind was removed .*; train the"):
        old.stage(name)
    again = recipe_from_json(recipe_to_json(old))
    assert again == old


def test_every_key_of_the_first_release_has_a_successor() -> None:
    chosen = set()
    for keys in LOSS_KEYS.values():
        for key, new in keys.items():
            chosen |= set(new) if isinstance(new, dict) else {key}
    # The video model has no motion channels any more.
    assert chosen | {"flow_motion"} == set(LOSS_DEFAULTS)
    stages = json.loads(SMALL.read_text())["stages"]
    assert set(STAGE_KEYS) <= set(stages[0]) and set(DATA_KEYS) <= set(stages[0]["data"])
    assert set(LOSS_DEFAULTS) == set(stages[0]["losses"])
    assert {stage["kind"] for stage in stages} <= {*KINDS, *REMOVED_KINDS, *LOSS_KEYS}


def test_a_network_that_no_stage_runs_changes_no_fingerprint() -> None:
    """Runs from before image inpainting go on."""
    small = recipe_by_name("small")
    before = replace(small, model=replace(small.model, image_inpainting=ImageInpaintingConfig()))
    assert before.model != small.model
    for stage in small.stages:
        assert fingerprint(before, stage.name) == fingerprint(small, stage.name)


@pytest.mark.parametrize("stage", FINGERPRINTS)
def test_fingerprints_of_the_first_release_are_known(stage: str) -> None:
    assert fingerprint_of(json.loads(TEST.read_text()), stage, "") == FINGERPRINTS[stage]


@pytest.mark.parametrize("damage", [{"stages": 3}, {"stages": [1]}, {"stages": [{"kind": []}]}])
def test_values_of_another_kind_are_refused(damage: dict) -> None:
    data = json.loads(TEST.read_text()) | damage
    with pytest.raises(ConfigError, match="recipe"):
        recipe_from_json(json.dumps(data))


def test_priors_are_trained_as_parts_of_their_own() -> None:
    old = recipe_from_json(SMALL.read_text())
    assert old.stage("depth").trained == ("monocular_depth",)
    assert old.stage("branch").trained == ("motion_unet",)


@pytest.mark.parametrize("name", FINGERPRINTS)
def test_every_stage_of_the_test_recipe_learns(name: str) -> None:
    recipe = recipe_from_json(TEST.read_text())
    stage = make_stage(recipe.stage(name), model=recipe.model)
    shake_heads(stage)
    before = {key: value.clone() for key, value in stage.state_dict().items()}
    trained = [parameter for parameter in stage.parameters() if parameter.requires_grad]
    optimizer = torch.optim.SGD(trained, 1e-2)
    total = stage(make_batch(stage.plan.recipe))[TOTAL].sum()
    total.backward()
    optimizer.step()
    changed = {key for key, value in stage.state_dict().items() if not value.equal(before[key])}
    assert bool(total.isfinite()) and {key.split(".")[0] for key in changed} == set(stage.trained)
    assert all(bool(parameter.isfinite().all()) for parameter in trained)


@pytest.mark.parametrize("name", STAGES_OF_SMALL)
def test_every_stage_of_the_small_recipe_can_be_created(name: str) -> None:
    recipe = recipe_from_json(SMALL.read_text())
    stage = recipe.stage(name)
    needed = STAGES[stage.kind].needed(recipe.model)
    networks = create_networks(recipe.model, "meta", parts=needed)
    plan = StagePlan(model=recipe.model, recipe=stage, seed=0, features=SquaredDifference())
    created = create_stage(networks, plan)
    assert {part for part, _ in created.named_children()} == set(needed)
    learns = {key.split(".")[0] for key, one in created.named_parameters() if one.requires_grad}
    assert learns == set(stage.trained)


def test_unknown_weights_are_named() -> None:
    data = json.loads(TEST.read_text())
    data["stages"][0]["losses"]["colour"] = 1.0
    with pytest.raises(ConfigError, match=r"losses: expected the keys .* got 'colour'"):
        recipe_from_json(json.dumps(data))


def test_newer_versions_are_refused() -> None:
    data = json.loads(recipe_to_json(recipe_by_name("test"))) | {"version": 3}
    with pytest.raises(ConfigError, match="expected a version up to 2, got 3"):
        recipe_from_json(json.dumps(data))


def begun_by_the_first_release(folder: Path, clips: Path) -> StageRequest:
    """Two steps of the autoencoder, stored in the words of the first release."""
    data = json.loads(TEST.read_text())
    vae = data["stages"][0]
    source = {"kind": "shards", "folder": str(clips), "split": "training", "weight": 1.0}
    vae["data"]["sources"] = [source | {"still_share": 1.0}]
    text = json.dumps(data)
    request = StageRequest(
        recipe=recipe_from_json(text), stage="vae", folder=folder, stop_after_steps=2, device="cpu"
    )
    train_stage(request)
    old = fingerprint_of(data, "vae", load_features(None).name)
    for state in (folder / "vae" / "checkpoints").glob(f"*/{STATE_FILE}"):
        changes = {"version": 1, "recipe": vae, "fingerprint": old}
        state.write_text(json.dumps(json.loads(state.read_text()) | changes))
    (folder / "vae" / RECIPE_FILE).write_text(text)
    return request


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"))


def test_a_run_of_the_first_release_goes_on(clips: Path, tmp_path: Path) -> None:
    request = begun_by_the_first_release(tmp_path, clips)
    before = (tmp_path / "vae" / RECIPE_FILE).read_text()
    for step in (4, 6):
        assert train_stage(request).step == step
    assert (tmp_path / "vae" / RECIPE_FILE).read_text() == before
    log = (tmp_path / "vae" / "log.jsonl").read_text().splitlines()
    assert [json.loads(row)["step"] for row in log if '"event": "step"' in row] == list(range(6))


def test_a_run_of_another_recipe_is_refused(clips: Path, tmp_path: Path) -> None:
    request = begun_by_the_first_release(tmp_path, clips)
    other = replace(request, recipe=replace(request.recipe, seed=1))
    with pytest.raises(CheckpointError, match="expected a checkpoint of stage vae"):
        train_stage(other)


def test_only_the_first_releases_file_of_the_same_stage_counts(tmp_path: Path) -> None:
    recipe, file = recipe_from_json(TEST.read_text()), tmp_path / "recipe.json"
    assert earlier_fingerprint(recipe, "vae", file, "") is None
    shutil.copy(TEST, file)
    assert earlier_fingerprint(recipe, "vae", file, "") == FINGERPRINTS["vae"]
    moved = with_clips(recipe, tmp_path)
    assert earlier_fingerprint(moved, "vae", file, "") is None
    for text in (recipe_to_json(recipe), "[]", "{"):
        file.write_text(text)
        assert earlier_fingerprint(recipe, "vae", file, "") is None
    assert fingerprint(recipe, "vae") != FINGERPRINTS["vae"]

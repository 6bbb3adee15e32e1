"""Recipes whose generator learns from folders of encoded clips."""

from pathlib import Path

import pytest

from diff4splat.configs.recipes import recipe_by_name, with_clips, with_latents
from diff4splat.errors import ConfigError
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe_json import recipe_from_json, recipe_to_json


@pytest.mark.parametrize("name", ["test", "small"])
def test_every_folder_becomes_a_source(name: str, tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "two"]
    data = (
        with_latents(recipe_by_name(name), "video_diffusion", folders).stage("video_diffusion").data
    )
    assert [source.kind for source in data.sources] == ["latents", "latents"]
    assert [source.folder for source in data.sources] == [str(folder) for folder in folders]
    assert len({source.weight for source in data.sources}) == 1
    assert data.workers == 0, "latents lie in memory already"


def test_the_share_of_still_clips_stays(tmp_path: Path) -> None:
    source = 'stages.video_diffusion.data.sources=[{"kind": "worlds", "still_share": 0.75}]'
    recipe = override(recipe_by_name("test"), [source])
    data = with_latents(recipe, "video_diffusion", [tmp_path]).stage("video_diffusion").data
    assert [source.still_share for source in data.sources] == [0.75]


def test_nothing_else_changes(tmp_path: Path) -> None:
    before = recipe_by_name("small")
    after = with_latents(before, "video_diffusion", [tmp_path])
    assert (after.model, after.trainer, after.seed) == (before.model, before.trainer, before.seed)
    for one, other in zip(before.stages, after.stages, strict=True):
        assert one.name == other.name and (one == other) == (one.name != "video_diffusion")
    one, other = before.stage("video_diffusion"), after.stage("video_diffusion")
    assert (one.steps, one.losses, one.trained) == (other.steps, other.losses, other.trained)
    assert (one.data.frames, one.data.size_px) == (other.data.frames, other.data.size_px)


def test_folders_are_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    recipe = with_latents(recipe_by_name("test"), "video_diffusion", [Path("latents")])
    (source,) = recipe.stage("video_diffusion").data.sources
    assert source.folder == str(tmp_path / "latents")


def test_the_recipe_can_be_written_and_read(tmp_path: Path) -> None:
    recipe = with_latents(recipe_by_name("test"), "video_diffusion", [tmp_path])
    assert recipe_from_json(recipe_to_json(recipe)) == recipe


def test_latents_take_the_place_of_clips(tmp_path: Path) -> None:
    recipe = with_clips(recipe_by_name("test"), tmp_path / "clips")
    recipe = with_latents(recipe, "video_diffusion", [tmp_path / "latents"])
    kinds = {stage.name: stage.data.sources[0].kind for stage in recipe.stages}
    assert kinds.pop("video_diffusion") == "latents"
    assert set(kinds.values()) == {"shards"}


@pytest.mark.parametrize("stage", ["vae", "dynamic", "joint"])
def test_only_generators_read_latents(stage: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="latents for video_diffusion or video_distillation"):
        with_latents(recipe_by_name("test"), stage, [tmp_path])


def test_an_unknown_stage_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere"):
        with_latents(recipe_by_name("test"), "nowhere", [tmp_path])

"""``--clips FOLDER:WEIGHT`` and ``--commercial-only``: what the options become."""

from dataclasses import replace
from pathlib import Path

import pytest
from clip_shards import exact_clip

from diff4splat.cli.train import Train
from diff4splat.configs.recipes import (
    for_commercial_use,
    recipe_by_name,
    weighted_folder,
    with_clips,
    with_mixture,
)
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import ConfigError, Diff4SplatError
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.recipe.recipe import Recipe


@pytest.mark.parametrize(
    ("text", "folder", "weight"),
    [
        ("clips", "clips", 1.0),
        ("clips:0.3", "clips", 0.3),
        ("a:b:2", "a:b", 2.0),
        ("a:b", "a:b", 1.0),
        ("a folder:1e-3", "a folder", 1e-3),
    ],
)
def test_a_weight_follows_the_last_colon(text: str, folder: str, weight: float) -> None:
    assert weighted_folder(text) == (Path(folder), weight)


def test_a_folder_that_exists_is_never_split(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "clips:3").mkdir()
    monkeypatch.chdir(tmp_path)
    assert weighted_folder("clips:3") == (Path("clips:3"), 1.0)
    assert weighted_folder("clips:3:2") == (Path("clips:3"), 2.0)


@pytest.mark.parametrize("weight", ["0", "-1", "inf", "nan"])
def test_weights_that_say_nothing_are_refused(weight: str) -> None:
    with pytest.raises(ConfigError, match="expected a weight above 0"):
        weighted_folder(f"clips:{weight}")


def test_every_stage_gets_the_mixture() -> None:
    recipe = with_mixture(recipe_by_name("test"), [(Path("a"), 1.0), (Path("b"), 0.25)])
    for stage in recipe.stages:
        assert [source.weight for source in stage.data.sources] == [1.0, 0.25]


def test_commercial_use_leaves_other_licences_out(tmp_path: Path) -> None:
    """Five of six clips forbid it: nothing but the sixth is ever drawn."""
    with ShardWriter(tmp_path, ShardOptions(generator="oracle 1")) as writer:
        for number in range(6):
            clip = exact_clip(number, True)
            licence = "CC-BY-4.0" if number == 4 else "CC-BY-NC-4.0"
            note = replace(clip.note, identifier=f"clip-{number}", license=licence)
            writer.write(replace(clip, note=note))
    recipe = with_clips(recipe_by_name("test"), tmp_path)
    assert not any(stage.data.commercial_only for stage in recipe.stages)
    allowed = for_commercial_use(recipe)
    assert all(stage.data.commercial_only for stage in allowed.stages)
    given = Train(config="test", stage="vae", clips=(str(tmp_path),), commercial_only=True)
    assert given.recipe() == allowed
    with pytest.raises(Diff4SplatError, match="commercial"):
        ClipSamples.open(for_commercial_use(with_nothing_allowed(tmp_path)).stage("vae"), 0)


def with_nothing_allowed(folder: Path) -> Recipe:
    out = folder / "none allowed"
    with ShardWriter(out, ShardOptions(generator="oracle 1")) as writer:
        clip = exact_clip(0, True)
        writer.write(replace(clip, note=replace(clip.note, license="CC-BY-NC-4.0")))
    return with_clips(recipe_by_name("test"), out)

"""Every recipe by name."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from diff4splat.configs.distil import distil_recipe
from diff4splat.configs.paper import paper_recipe
from diff4splat.configs.small import small_recipe
from diff4splat.configs.test import test_recipe
from diff4splat.errors import ConfigError
from diff4splat.io.require_file import read_text
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_from_json

RECIPES: Mapping[str, Callable[[], Recipe]] = MappingProxyType(
    {"test": test_recipe, "small": small_recipe, "paper": paper_recipe, "distil": distil_recipe}
)


def recipe_by_name(name: str) -> Recipe:
    """The recipe of that name.

    Raises:
        ConfigError: there is none.
    """
    if name not in RECIPES:
        raise ConfigError(
            f"--config: expected one of {', '.join(RECIPES)} or backbone, got {name!r}"
        )
    return RECIPES[name]()


def find_recipe(name_or_file: str) -> Recipe:
    """A recipe by name, or from a JSON file.

    Raises:
        ConfigError: neither, or the file is not a recipe.
    """
    if not name_or_file.endswith(".json"):
        return recipe_by_name(name_or_file)
    try:
        return recipe_from_json(read_text(Path(name_or_file), "a recipe in JSON", ConfigError))
    except ConfigError as error:
        raise ConfigError(f"--config {name_or_file}: {error}") from error


WeightedFolder = tuple[Path, float]
"""A folder of shards and its share of the samples, relative to the others."""


def with_clips(recipe: Recipe, folder: Path) -> Recipe:
    """The recipe with every source replaced by a folder of shards; shares of static clips stay."""
    return with_mixture(recipe, [(folder, 1.0)])


def with_mixture(recipe: Recipe, folders: Sequence[WeightedFolder]) -> Recipe:
    """The recipe with every source replaced by folders of shards, mixed by weight."""
    stages = [replace(stage, data=_from_folders(stage.data, folders)) for stage in recipe.stages]
    return replace(recipe, stages=tuple(stages))


def weighted_folder(text: str) -> WeightedFolder:
    """``FOLDER`` or ``FOLDER:WEIGHT``; a folder that exists is never split.

    Raises:
        ConfigError: the weight is not a number above 0.
    """
    path, separator, weight = text.rpartition(":")
    if not separator or Path(text).is_dir():
        return Path(text), 1.0
    try:
        value = float(weight)
    except ValueError:
        return Path(text), 1.0
    if not 0 < value < math.inf:
        raise ConfigError(f"--clips {text}: expected a weight above 0, got {weight}")
    return Path(path), value


def for_commercial_use(recipe: Recipe) -> Recipe:
    """The recipe that reads no clip of a licence not known to allow commercial use."""
    stages = [
        replace(stage, data=replace(stage.data, commercial_only=True)) for stage in recipe.stages
    ]
    return replace(recipe, stages=tuple(stages))


def with_latents(recipe: Recipe, stage: str, folders: Sequence[Path]) -> Recipe:
    """The recipe whose video ``stage`` learns from folders of encoded clips."""
    before = recipe.stage(stage)
    share = before.data.sources[0].still_share
    sources = tuple(
        SourceSettings(kind="latents", folder=str(folder.resolve()), still_share=share)
        for folder in folders
    )
    changed = replace(before, data=replace(before.data, sources=sources, workers=0))
    stages = tuple(changed if one is before else one for one in recipe.stages)
    return replace(recipe, stages=stages)


def _from_folders(data: DataSettings, folders: Sequence[WeightedFolder]) -> DataSettings:
    sources = [
        replace(source, kind="shards", folder=str(folder.resolve()), weight=source.weight * weight)
        for source in data.sources
        for folder, weight in folders
    ]
    return replace(data, sources=tuple(sources))

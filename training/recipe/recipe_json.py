"""Recipes as JSON: every field, strictly read.

    {"version": 2, "name": …, "seed": …, "model": {…}, "stages": [{"name": "vae", …}, …], …}

Files without a version are those of the first release; ``legacy`` upgrades them.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.models.config.model import ModelConfig
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.training.config_codec import TypedReader
from diff4splat.training.recipe.legacy import upgraded
from diff4splat.training.recipe.losses import LOSSES, Losses
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe

VERSION = 2


def recipe_to_json(recipe: Recipe) -> str:
    """Every field, sorted, as indented JSON."""
    return json.dumps(recipe_to_dict(recipe), indent=2, sort_keys=True) + "\n"


def recipe_to_dict(recipe: Recipe) -> dict[str, Any]:
    """Every field and the version, as plain values."""
    return {"version": VERSION} | json.loads(json.dumps(asdict(recipe), sort_keys=True))


def recipe_from_json(text: str) -> Recipe:
    """The recipe that ``recipe_to_json`` wrote, in this release or an earlier one.

    Raises:
        ConfigError: no JSON, a newer version, an unknown or missing key, or a value of the wrong
            kind.
    """
    try:
        data = decode_json(text)
    except FileFormatError as error:
        raise ConfigError(f"recipe: {error}") from error
    return recipe_from_dict(data)


def recipe_from_dict(data: Any) -> Recipe:
    """The recipe of plain values.

    Raises:
        ConfigError: as ``recipe_from_json``.
    """
    if isinstance(data, dict):
        data = _current(data)
    readers = {ModelConfig: lambda value: ModelConfig.from_json(json.dumps(value))}
    reader = TypedReader(
        error_type=ConfigError, readers=readers, dependent={StageRecipe: _losses_of_kind}
    )
    return reader.read(Recipe, data, "recipe")


def _current(data: Mapping[str, Any]) -> dict[str, Any]:
    """The values of this version, without the version."""
    version = data.get("version", 1)
    if version == 1:
        return upgraded(data)
    if version != VERSION:
        raise ConfigError(
            f"recipe: expected a version up to {VERSION}, got {version!r}; "
            "use the release that wrote it"
        )
    return {key: value for key, value in data.items() if key != "version"}


def _losses_of_kind(stage: Mapping[str, Any]) -> dict[str, Any]:
    return {"losses": LOSSES.get(str(stage.get("kind")), Losses)}

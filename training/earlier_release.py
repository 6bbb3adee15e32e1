"""Runs that an earlier release began: the same stage has another fingerprint there."""

from pathlib import Path

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.require_file import read_text
from diff4splat.paths.formats.json_text import decode_object
from diff4splat.training.recipe.fingerprint import fingerprint, fingerprint_of
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_from_dict


def earlier_fingerprint(recipe: Recipe, stage: str, file: Path, features: str) -> str | None:
    """The fingerprint that the first release gave this stage.

    ``file`` is the recipe beside the stage's checkpoints. None unless the first release wrote it
    and it means the same as ``recipe``.
    """
    try:
        data = decode_object(read_text(file, "a recipe"))
        if data.get("version", 1) != 1:
            return None
        same = fingerprint(recipe_from_dict(data), stage, features)
    except (FileFormatError, ConfigError):
        return None
    if same != fingerprint(recipe, stage, features):
        return None
    return fingerprint_of(data, stage, features)

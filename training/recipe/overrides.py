"""Changes of a recipe by dotted keys.

A key names a field: ``trainer.precision``, ``model.ldrm.width``, or ``stages.vae.steps`` with the
stage's name.
"""

from collections.abc import Sequence
from typing import Any

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_from_dict, recipe_to_dict


def override(recipe: Recipe, changes: Sequence[str]) -> Recipe:
    """The recipe with ``key=value`` changes; values are JSON, or plain words.

    Raises:
        ConfigError: no "=", an unknown key, or a value of the wrong kind.
    """
    data = recipe_to_dict(recipe)
    version = data.pop("version")
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals:
            raise ConfigError(f"--set: expected key=value, got {change!r}")
        parent, last = _parent(data, key.strip())
        parent[last] = _parsed(text.strip())
    return recipe_from_dict(data | {"version": version})


def _parent(data: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """The object that holds a dotted key, and the key's last word."""
    words, parent = key.split("."), data
    for depth, word in enumerate(words[:-1]):
        parent = _child(parent, word, ".".join(words[: depth + 1]))
        if isinstance(parent, list) and depth == 0:
            parent = {str(stage["name"]): stage for stage in parent if _is_named(stage)}
    if not isinstance(parent, dict) or words[-1] not in parent:
        _refuse(key, parent)
    return parent, words[-1]


def _is_named(stage: Any) -> bool:
    """Earlier changes may have put anything in the place of a stage."""
    return isinstance(stage, dict) and "name" in stage


def _child(parent: Any, word: str, path: str) -> Any:
    if not isinstance(parent, dict) or word not in parent:
        _refuse(path, parent)
    return parent[word]


def _refuse(key: str, parent: Any) -> None:
    known = ", ".join(parent) if isinstance(parent, dict) else "no keys below it"
    _, _, last = key.rpartition(".")
    raise ConfigError(f"--set {key}: expected one of {known}, got {last!r}")


def _parsed(text: str) -> Any:
    try:
        return decode_json(text)
    except FileFormatError:
        return text

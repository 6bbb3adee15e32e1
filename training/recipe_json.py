"""Recipes as JSON: every field, strictly read; changes by dotted keys; and a fingerprint.

    {"name": …, "seed": …, "model": {…}, "stages": [{"name": "vae", …}, …], "trainer": {…}}

A dotted key names a field: ``trainer.precision``, ``model.ldrm.width``, or ``stages.vae.steps``
with the stage's name.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.training.recipe import Recipe
from diff4splat.training.typed_json import TypedReader


def recipe_to_json(recipe: Recipe) -> str:
    """Every field, sorted, as indented JSON."""
    return json.dumps(asdict(recipe), indent=2, sort_keys=True) + "\n"


def recipe_from_json(text: str) -> Recipe:
    """The recipe that ``recipe_to_json`` wrote.

    Raises:
        ConfigError: no JSON, an unknown or missing key, or a value of the wrong kind.
    """
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ConfigError(f"recipe: expected JSON, got {error}") from error
    return _recipe(data)


def changed(recipe: Recipe, changes: Sequence[str]) -> Recipe:
    """The recipe with ``key=value`` changes; values are JSON, or plain words.

    Raises:
        ConfigError: no "=", an unknown key, or a value of the wrong kind.
    """
    data = json.loads(recipe_to_json(recipe))
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals:
            raise ConfigError(f"--set: expected key=value, got {change!r}")
        place, last = _place(data, key.strip())
        place[last] = _parsed(text.strip())
    return _recipe(data)


def fingerprint(recipe: Recipe, stage: str, features: str = "") -> str:
    """Twelve hexadecimal digits of what decides one stage's weights; ``features`` is a name.

    How a run is carried out (``trainer``, micro batches, worker processes, where shards lie) is
    left out, and other stages too.
    """
    own = asdict(recipe.stage(stage))
    own.pop("micro_batch")
    for name in ("workers", "in_memory"):
        own["data"].pop(name)
    for source in own["data"]["sources"]:
        source.pop("folder")
    facts = {"seed": recipe.seed, "model": json.loads(recipe.model.to_json()), "stage": own}
    if own["losses"]["perceptual"]:
        facts["features"] = features
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


def _recipe(data: Any) -> Recipe:
    own = {ModelConfig: lambda value: ModelConfig.from_json(json.dumps(value))}
    return TypedReader(refusal=ConfigError, own=own).read(Recipe, data, "recipe")


def _place(data: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """The object that holds a dotted key, and the key's last word."""
    words, place = key.split("."), data
    for depth, word in enumerate(words[:-1]):
        place = _step(place, word, ".".join(words[: depth + 1]))
        if isinstance(place, list) and depth == 0:
            place = {stage["name"]: stage for stage in place}
    if not isinstance(place, dict) or words[-1] not in place:
        _refuse(key, place)
    return place, words[-1]


def _step(place: Any, word: str, so_far: str) -> Any:
    if not isinstance(place, dict) or word not in place:
        _refuse(so_far, place)
    return place[word]


def _refuse(key: str, place: Any) -> None:
    known = ", ".join(place) if isinstance(place, dict) else "no keys below it"
    _, _, last = key.rpartition(".")
    raise ConfigError(f"--set {key}: expected one of {known}, got {last!r}")


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return text

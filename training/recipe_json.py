"""Recipes as JSON: every field, strictly read; changes by dotted keys; and a fingerprint.

    {"name": …, "seed": …, "model": {…}, "stages": [{"name": "vae", …}, …], "trainer": {…}}

A dotted key names a field: ``trainer.precision``, ``model.ldrm.width``, or ``stages.vae.steps``
with the stage's name.
"""

import hashlib
import json
import types
from collections.abc import Sequence
from dataclasses import MISSING, asdict, fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from diff4splat.errors import ConfigError
from diff4splat.models.config import ModelConfig
from diff4splat.training.recipe import Recipe


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
    return _value(Recipe, data, "recipe")


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
    return _value(Recipe, data, "recipe")


def fingerprint(recipe: Recipe, stage: str, features: str = "") -> str:
    """Twelve hexadecimal digits of what decides one stage's weights; ``features`` is a name.

    How a run is carried out (``trainer``, micro batches, worker processes, where shards lie) is
    left out, and other stages too.
    """
    own = asdict(recipe.stage(stage))
    own.pop("micro_batch")
    own["data"].pop("workers")
    for source in own["data"]["sources"]:
        source.pop("folder")
    facts = {"seed": recipe.seed, "model": json.loads(recipe.model.to_json()), "stage": own}
    if own["losses"]["perceptual"]:
        facts["features"] = features
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


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


def _value(kind: Any, value: Any, where: str) -> Any:
    """``value`` as an instance of the annotated ``kind``."""
    if kind is ModelConfig:
        return ModelConfig.from_json(json.dumps(value))
    if is_dataclass(kind):
        return _built(kind, value, where)
    if get_origin(kind) is tuple:
        return _tuple(get_args(kind), value, where)
    if get_origin(kind) is Literal:
        choices = get_args(kind)
        _require(value in choices, where, f"one of {', '.join(map(str, choices))}", value)
        return value
    numbers = {int: (int,), float: (int, float), str: (str,), bool: (bool,)}[kind]
    fits = isinstance(value, numbers) and (kind is bool or not isinstance(value, bool))
    _require(fits, where, kind.__name__, value)
    return float(value) if kind is float else value


def _built(kind: type, value: Any, where: str) -> Any:
    _require(isinstance(value, dict), where, "an object", value)
    hints, known = get_type_hints(kind), {field.name: field for field in fields(kind)}
    for key in value:
        _require(key in known, where, f"the keys {', '.join(known)}", key)
    for name, field in known.items():
        optional = field.default is not MISSING or field.default_factory is not MISSING
        _require(name in value or optional, where, f"the key {name!r}", "none")
    return kind(**{key: _value(hints[key], one, f"{where}.{key}") for key, one in value.items()})


def _tuple(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    _require(isinstance(value, list), where, "a list", value)
    if kinds[-1] is types.EllipsisType or kinds[-1] is Ellipsis:
        kinds = (kinds[0],) * len(value)
    _require(len(value) == len(kinds), where, f"{len(kinds)} values", value)
    return tuple(
        _value(kind, one, f"{where}[{index}]")
        for index, (kind, one) in enumerate(zip(kinds, value, strict=True))
    )


def _require(holds: bool, where: str, expected: str, got: Any) -> None:
    if not holds:
        raise ConfigError(f"{where}: expected {expected}, got {got!r}")

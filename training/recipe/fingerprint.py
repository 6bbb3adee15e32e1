"""The fingerprint of a stage: what decides its weights, as twelve hexadecimal digits."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_dict


def fingerprint(recipe: Recipe, stage: str, features: str = "") -> str:
    """Fingerprint of one stage; ``features`` names the perceptual features.

    How a run is carried out (``trainer``, micro batches, worker processes, folders of shards) does
    not count, and other stages do not count either.

    Raises:
        ConfigError: the recipe has no such stage.
    """
    recipe.stage(stage)
    return fingerprint_of(recipe_to_dict(recipe), stage, features)


def fingerprint_of(recipe: Mapping[str, Any], stage: str, features: str) -> str:
    """The same of a recipe as plain values, of any version."""
    (found,) = (one for one in recipe["stages"] if one["name"] == stage)
    facts = {"seed": recipe["seed"], "model": _model(recipe["model"]), "stage": decisive(found)}
    if _uses_features(found["losses"]):
        facts["features"] = features
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


def decisive(stage: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a stage's recipe that decide its weights."""
    data = {key: value for key, value in stage["data"].items() if key not in _NOT_DECISIVE}
    data["sources"] = [
        {
            key: value
            for key, value in source.items()
            if key != "folder" and not (key in _SOURCE_ADDED and _SOURCE_ADDED[key] == value)
        }
        for source in data["sources"]
    ]
    # Stages of recipes from before these settings keep their fingerprint.
    data = {key: value for key, value in data.items() if not _unchanged(key, value)}
    kept = {
        key: value
        for key, value in stage.items()
        if key != "micro_batch" and not (key in _STAGE_ADDED and _STAGE_ADDED[key] == value)
    }
    losses = {
        key: value
        for key, value in stage["losses"].items()
        if not (key in _LOSS_ADDED and _LOSS_ADDED[key] == value)
    }
    return kept | {"data": data, "losses": losses}


def _model(model: Mapping[str, Any]) -> dict[str, Any]:
    """Without settings of later releases that change nothing: runs from before them go on."""
    return {
        key: {name: one for name, one in value.items() if one or name not in _MODEL_ADDED}
        if isinstance(value, Mapping)
        else value
        for key, value in _without_plain(model).items()
        if key not in _IN_NO_STAGE and not (key in _UNUSED_AT and not value[_UNUSED_AT[key]])
    }


def _without_plain(model: Mapping[str, Any]) -> dict[str, Any]:
    """The same without the layout, the encoder and the backbone that all models had."""
    plain = {
        ("vae", "layout"): "plain",
        ("text", "encoder"): "bytes",
        ("monocular_depth", "backbone_size"): "lite0",
        ("object_mask", "backbone_size"): "lite0",
    }
    return {
        key: {n: one for n, one in value.items() if plain.get((key, n)) != one}
        if isinstance(value, Mapping)
        else value
        for key, value in model.items()
    }


_MODEL_ADDED = (
    "decoder_widths",
    "vocabulary",
    "head_width",
    "padded_text_tokens",
    "condition_channels",
    "image_width",
    "groups",
    "tile_px",
    "expert_boundary",
    "instance_channels",
    "uncertainty",
    "object_mask",
    "image_classifier",
)
"""Settings of networks that are off where they are empty or 0."""
_UNUSED_AT = {"joint": "level_width", "image_encoder": "width", "object_shadow": "width"}
"""Sections of later releases, and what is 0 in a model without them."""
_IN_NO_STAGE = ("image_inpainting",)
"""Networks with public weights that no stage runs."""
_STAGE_ADDED = {"tuning": "full", "lora_rank": 16}
_SOURCE_ADDED = {"depth_loss": "true", "motion_loss": "true", "views": 0, "unit": ""}
_NOT_DECISIVE = ("workers", "in_memory", "photographs")
_LOSS_ADDED = {"window_consistency": 0.0, "instances": 0.0, "uncertainty": 0.0}
_ADDED = {
    "unit": "median_depth",
    "fps": 0.0,
    "commercial_only": False,
    "cutouts": "",
    "single_event_share": 0.0,
}
"""Settings of later releases, with the value that changes nothing."""


def _uses_features(losses: Mapping[str, Any]) -> bool:
    """Whether a perceptual term counts, at any depth."""
    nested = [value for value in losses.values() if isinstance(value, Mapping)]
    return bool(losses.get("perceptual")) or any(map(_uses_features, nested))


def _unchanged(key: str, value: Any) -> bool:
    if key == "view_sides_px":
        return not value
    return key in _ADDED and _ADDED[key] == value

"""Configurations of version 1, whose priors were fields of other parts."""

import json
from pathlib import Path
from typing import Any

import pytest

from diff4splat.errors import ConfigError
from diff4splat.models.config.legacy import upgrade_config
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size

GOLDEN = Path(__file__).parents[3] / "golden" / "model_v1" / "config.json"


def stored() -> dict[str, Any]:
    return json.loads(GOLDEN.read_text(encoding="utf-8"))


def read(data: dict[str, Any]) -> ModelConfig:
    return ModelConfig.from_json(json.dumps(data))


def test_every_field_has_its_value_under_the_new_name() -> None:
    config = read(stored())
    assert (config.name, config.frames, config.size_px) == ("tiny", 5, (32, 32))
    assert config.vae.pca_shortcut
    assert (config.text.relative_position_buckets, config.text.max_distance) == (4, 8)
    assert (config.dit.prediction_type, config.dit.render_condition) == ("clean", True)
    assert config.ldrm.input == "latents"
    assert config.deformation.time_frequencies == 2
    assert config.deformation.static_threshold_px == 0.5
    refinement = config.refinement
    assert (refinement.channels, refinement.match_channels, refinement.border_cells) == (3, 2, 4)
    assert (refinement.cost_volume_depths, refinement.depth_range) == (3, (2.0, 9.0))
    motion = config.motion_unet
    assert config.monocular_depth.channels == 2
    assert (motion.width, motion.heads, motion.mask_refiner_width) == (4, 1, 2)
    assert config.default_fill == "none"


def test_upgraded_once_it_is_version_2() -> None:
    config = read(stored())
    assert ModelConfig.from_json(config.to_json()) == config
    assert read(stored() | {"version": 1}) == config


def test_without_a_depth_prior_the_video_model_fills() -> None:
    data = stored()
    data["detail"]["picture_width"] = 0
    assert read(data).default_fill == "video"


def first_release() -> dict[str, Any]:
    """The ``test`` size as it was stored before there were details, drafts and priors."""
    data = json.loads(tiny_size().to_json())
    for later in ("version", "refinement", "monocular_depth", "motion_unet", "default_fill"):
        del data[later]
    for later in ("prediction_type", "render_condition", "pooled_text"):
        del data["dit"][later]
    del data["vae"]["pca_shortcut"], data["ldrm"]["input"]
    del data["deformation"]["static_threshold_px"]
    data["deformation"]["octaves"] = data["deformation"].pop("time_frequencies")
    data["text"]["buckets"] = data["text"].pop("relative_position_buckets")
    return data


def test_the_first_release_had_none_of_the_later_parts() -> None:
    assert read(first_release()) == tiny_size()


def test_the_data_that_is_upgraded_stays_as_it_was() -> None:
    data = stored()
    upgrade_config(data)
    assert data == stored()


@pytest.mark.parametrize(
    ("section", "value"), [("detail", 3), ("dit", None), ("vae", [1]), ("text", "x")]
)
def test_damaged_sections_are_refused(section: str, value: object) -> None:
    with pytest.raises(ConfigError, match="expected"):
        read(stored() | {section: value})


@pytest.mark.parametrize("section", ["detail", "dit", "vae"])
def test_unknown_fields_are_refused(section: str) -> None:
    data = stored()
    data[section]["colour"] = 1
    with pytest.raises(ConfigError, match="got 'colour'"):
        read(data)

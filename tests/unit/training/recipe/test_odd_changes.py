"""``--set`` with values that earlier changes, or nobody, should have given."""

import pytest

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.settings_json import apply_changes
from diff4splat.training.recipe.overrides import override


@pytest.mark.parametrize("value", ["5", "[1]", "[{}]", '[{"name": []}]', '"a"', "{}", "[[]]"])
def test_a_change_of_a_stage_that_another_change_removed(value: str) -> None:
    with pytest.raises(ConfigError, match="--set stages"):
        override(recipe_by_name("test"), [f"stages={value}", "stages.vae.steps=2"])


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 900, "[" * 100_000, "NaN", '"\\ud800"'])
def test_values_that_break_the_decoder_are_refused(value: str) -> None:
    """ValueError and RecursionError before."""
    with pytest.raises(ConfigError, match="expected"):
        override(recipe_by_name("test"), [f"stages.vae.steps={value}"])
    with pytest.raises(ConfigError, match="expected"):
        apply_changes(FitSettings(), [f"fine_steps={value}"])


@pytest.mark.parametrize("key", ["", ".", "a", "density.", "density..budget", "motion.a", "²"])
def test_keys_that_name_nothing_are_refused(key: str) -> None:
    with pytest.raises(ConfigError, match="expected"):
        override(recipe_by_name("test"), [f"{key}=1"])
    with pytest.raises(ConfigError, match="expected"):
        apply_changes(FitSettings(), [f"{key}=1"])

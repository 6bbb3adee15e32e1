"""What a user may choose, and what is chosen for them."""

import pytest

from diff4splat.errors import ConfigError
from diff4splat.flow.guidance import Guidance
from diff4splat.flow.levels import make_levels
from diff4splat.generation.settings import (
    ENOUGH_STEPS,
    GenerationSettings,
    MotionSettings,
    require_seed,
    why_unguided,
)


def test_the_schedule_follows_the_number_of_steps_unless_named() -> None:
    few, enough = ENOUGH_STEPS - 1, ENOUGH_STEPS
    assert GenerationSettings(steps=few).levels == make_levels("uniform", few)
    assert GenerationSettings(steps=enough).levels == make_levels("log_snr", enough)
    named = GenerationSettings(steps=enough, schedule="uniform", shift=3.0)
    assert named.levels == make_levels("uniform", enough, 3.0)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(
    "wrong",
    [
        {"steps": 0},
        {"steps": 1001},
        {"min_opacity": 1.5},
        {"static_threshold_px": -1.0},
        {"static_threshold_px": float("nan")},
        {"fill": "magic"},
        {"min_opacity": float("nan")},
        {"color_matching_steps": -1},
        {"color_matching_steps": 101},
        {"photometric_steps": -1},
        {"photometric_steps": 1001},
        {"shift": 0.0},
        {"sampler": "magic"},
        {"key_times": 1},
        {"key_times": 1001},
        {"fill_stride": 0},
        {"fill_stride": 9},
    ],
)
def test_numbers_out_of_range_are_refused(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="expected"):
        GenerationSettings(**wrong)


@pytest.mark.parametrize("seed", [-1, 2**63, 10**30])
def test_seeds_that_no_generator_takes_are_refused(seed: int) -> None:
    with pytest.raises(ConfigError, match="--seed"):
        require_seed(seed)
    assert require_seed(2**63 - 1) == 2**63 - 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"steps": 0}, "--steps: expected 1 to 1000, got 0"),
        ({"shift": 0.0}, "shift"),
        ({"threshold": 1.5}, "motion threshold: expected 0 to 1, got 1.5"),
        ({"threshold": float("nan")}, "motion threshold: expected 0 to 1"),
    ],
)
def test_motion_settings_out_of_range_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        MotionSettings(**changes)


def test_motion_has_its_own_levels() -> None:
    assert MotionSettings(steps=4, shift=2.0).levels == make_levels("uniform", 4, 2.0)
    assert GenerationSettings(steps=4).motion.levels == make_levels("uniform", 1, 16.0)


def test_the_reason_for_fewer_passes_is_the_weight_or_the_interval() -> None:
    assert "weight of 1" in why_unguided(Guidance(weight=1.0))
    assert "interval" in why_unguided(Guidance(weight=3.0))

"""What a user may choose, and what is chosen for them."""

import pytest

from diff4splat.errors import ConfigError
from diff4splat.flow.levels import make_levels
from diff4splat.generation.settings import ENOUGH_STEPS, GenerationSettings, require_seed


def test_the_schedule_follows_the_number_of_steps_unless_named() -> None:
    few, enough = ENOUGH_STEPS - 1, ENOUGH_STEPS
    assert GenerationSettings(steps=few).levels == make_levels("uniform", few)
    assert GenerationSettings(steps=enough).levels == make_levels("log_snr", enough)
    named = GenerationSettings(steps=enough, schedule="uniform", shift=3.0)
    assert named.levels == make_levels("uniform", enough, 3.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"steps": 0},
        {"steps": 1001},
        {"min_opacity": 1.5},
        {"still_px": -1.0},
        {"color_steps": -1},
        {"shift": 0.0},
        {"sampler": "magic"},
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

"""What a user may choose, and what is chosen for them."""

import pytest

from diff4splat.errors import ConfigError
from diff4splat.flow.levels import make_levels
from diff4splat.models.settings import ENOUGH_STEPS, GenerationSettings


def test_the_schedule_follows_the_number_of_steps_unless_named() -> None:
    few, enough = ENOUGH_STEPS - 1, ENOUGH_STEPS
    assert GenerationSettings(steps=few).levels == make_levels("uniform", few)
    assert GenerationSettings(steps=enough).levels == make_levels("log_snr", enough)
    named = GenerationSettings(steps=enough, schedule="uniform", shift=3.0)
    assert named.levels == make_levels("uniform", enough, 3.0)


@pytest.mark.parametrize(
    "wrong",
    [{"steps": 0}, {"steps": 1001}, {"min_opacity": 1.5}, {"still_px": -1.0}, {"color_steps": -1}],
)
def test_numbers_out_of_range_are_refused(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="expected"):
        GenerationSettings(**wrong)


def test_a_shift_that_is_not_positive_is_refused_when_used() -> None:
    with pytest.raises(ConfigError, match="shift"):
        _ = GenerationSettings(shift=0.0).levels

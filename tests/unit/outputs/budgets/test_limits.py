"""Tolerances and budgets as text."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.outputs.budgets.limits import (
    Limits,
    error_from_loss,
    loss_from_error,
    parse_budget,
    parse_limits,
    parse_tolerance,
)


@pytest.mark.parametrize(
    ("text", "seconds", "memory_bytes"),
    [
        ("10s,4GB", 10, 4e9),
        ("4GB, 10s", 10, 4e9),
        ("2min", 120, None),
        ("500ms", 0.5, None),
        ("1.5h", 5400, None),
        ("800mb", None, 8e8),
        ("1GiB", None, 2**30),
    ],
)
def test_budgets(text: str, seconds: float | None, memory_bytes: float | None) -> None:
    assert parse_budget(text) == (seconds, memory_bytes)


@pytest.mark.parametrize(
    "text", ["", ",", "10", "s", "10 parsec", "-3s", "0s", "1s,2s", "1GB,2MB", "nans", "1e9s", "١s"]
)
def test_budgets_that_are_none(text: str) -> None:
    with pytest.raises(ConfigError, match="--budget"):
        parse_budget(text)


@pytest.mark.parametrize("text", ["0.5", "0.5s", "dB", "0dB", "-1dB", "infdB", "0.5%"])
def test_tolerances_that_are_none(text: str) -> None:
    with pytest.raises(ConfigError, match="--tolerance"):
        parse_tolerance(text)


def test_a_psnr_is_refused_with_the_loss_that_it_means() -> None:
    with pytest.raises(ConfigError, match=r"35 dB to the reference is a loss of 1.2 dB"):
        parse_tolerance("35dB")


@given(st.floats(1e-3, 20))
def test_loss_and_error_are_inverse(loss_db: float) -> None:
    assert loss_from_error(error_from_loss(loss_db)) == pytest.approx(loss_db, rel=1e-9)


def test_the_loss_is_that_of_a_scene_at_30_db() -> None:
    own = 10 ** (-30 / 10)
    with_error = -10 * math.log10(own + error_from_loss(0.5))
    assert with_error == pytest.approx(29.5)


def test_no_limit_allows_every_error() -> None:
    assert not parse_limits(None, None).given
    assert Limits().error == math.inf
    assert parse_limits("0.5 dB", "1min").given

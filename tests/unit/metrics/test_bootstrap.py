import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from diff4splat.errors import ConfigError, InputError
from diff4splat.metrics.bootstrap import bootstrap_interval


def skewed(count: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).exponential(size=count))


@pytest.mark.parametrize("level", [0.5, 0.95])
def test_against_scipy(level: float) -> None:
    values = skewed(25)
    got = bootstrap_interval(values, level, resamples=20_000)
    theirs = stats.bootstrap(
        (values.numpy(),),
        np.mean,
        confidence_level=level,
        n_resamples=20_000,
        method="BCa",
        rng=np.random.default_rng(1),
    ).confidence_interval
    width = theirs.high - theirs.low
    assert got.mean == pytest.approx(float(values.mean()))
    assert got.low == pytest.approx(theirs.low, abs=0.03 * width)
    assert got.high == pytest.approx(theirs.high, abs=0.03 * width)


def test_it_covers_as_often_as_it_says() -> None:
    hits = 0
    for seed in range(120):
        interval = bootstrap_interval(skewed(30, seed), 0.9, resamples=300, seed=seed)
        hits += interval.low <= 1 <= interval.high
    # 0.9 ± 4 standard deviations of 120 trials, less the known shortfall on skewed values.
    assert 0.76 <= hits / 120 <= 0.99


@settings(max_examples=25, deadline=None)
@given(
    values=st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=12),
    shift=st.floats(-100, 100),
    seed=st.integers(0, 9),
)
def test_the_interval_holds_together(values: list[float], shift: float, seed: int) -> None:
    tensor = torch.tensor(values, dtype=torch.float64)
    interval = bootstrap_interval(tensor, resamples=50, seed=seed)
    slack = 1e-9 * (1 + float(tensor.abs().max()))
    assert float(tensor.min()) - slack <= interval.low <= interval.high
    assert interval.high <= float(tensor.max()) + slack
    assert interval == bootstrap_interval(tensor, resamples=50, seed=seed)
    wider = bootstrap_interval(tensor, 0.99, resamples=50, seed=seed)
    assert wider.low <= interval.low + slack
    assert wider.high >= interval.high - slack


def test_another_seed_draws_other_values() -> None:
    values = skewed(20)
    one, other = (bootstrap_interval(values, resamples=50, seed=seed) for seed in (0, 1))
    assert (one.low, one.high) != (other.low, other.high)


def test_equal_values_are_certain() -> None:
    interval = bootstrap_interval(torch.full((5,), 3.0))
    assert (interval.low, interval.mean, interval.high) == (3, 3, 3)


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_values_say_so(count: int) -> None:
    interval = bootstrap_interval(torch.full((count,), 2.0))
    assert interval.count == count
    assert math.isnan(interval.low)
    assert math.isnan(interval.high)
    assert interval.mean == 2 if count else math.isnan(interval.mean)


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_values() -> None:
    values = torch.ones(3)
    with pytest.raises(ConfigError, match=r"level: expected a share between 0 and 1, got 95"):
        bootstrap_interval(values, 95)
    with pytest.raises(ConfigError, match="resamples: expected at least 1, got 0"):
        bootstrap_interval(values, resamples=0)
    with pytest.raises(InputError, match="expected finite numbers, got NaN or infinity; leave"):
        bootstrap_interval(torch.tensor([1.0, math.nan]))

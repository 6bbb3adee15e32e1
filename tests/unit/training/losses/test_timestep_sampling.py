import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from diff4splat.errors import ConfigError
from diff4splat.flow.levels import shift_levels
from diff4splat.training.losses.timestep_sampling import LevelDistribution, sample_levels

F64 = torch.float64
INSIDE = torch.linspace(0, 1, 101, dtype=F64)


def test_uniform_numbers_are_uniform_levels() -> None:
    assert torch.equal(sample_levels(INSIDE, LevelDistribution()), INSIDE)


@settings(max_examples=25, deadline=None)
@given(shift=st.floats(0.05, 20))
def test_the_shift_is_that_of_the_sampler(shift: float) -> None:
    levels = sample_levels(INSIDE, LevelDistribution(shift=shift))
    np.testing.assert_allclose(levels, shift_levels(INSIDE.tolist(), shift), rtol=1e-12)
    assert levels[0] == 0
    assert levels[-1] == 1


def test_the_logit_is_normal() -> None:
    levels = sample_levels(INSIDE[1:-1], LevelDistribution(kind="logit_normal", mean=0.3, std=1.7))
    expected = stats.norm.ppf(INSIDE[1:-1].numpy()) * 1.7 + 0.3
    np.testing.assert_allclose(torch.logit(levels), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32, F64])
@pytest.mark.parametrize("kind", ["uniform", "logit_normal"])
def test_levels_rise_and_stay_inside(kind: str, dtype: torch.dtype) -> None:
    levels = sample_levels(INSIDE.to(dtype), LevelDistribution(kind=kind, shift=5.0))
    assert levels.dtype == torch.promote_types(dtype, torch.float32)
    assert levels.isfinite().all()
    assert (levels.diff() > 0).all()
    assert [levels[0], levels[-1]] == [0, 1]


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        ({"kind": "cosine"}, "expected uniform or logit_normal, got 'cosine'"),
        ({"std": 0.0}, "std: expected a finite number above 0, got 0"),
        ({"shift": math.inf}, "shift: expected a finite number above 0, got inf"),
        ({"mean": math.nan}, "mean: expected a finite number, got nan"),
    ],
)
@pytest.mark.usefixtures("as_shipped")
def test_what_is_no_distribution(settings_: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        LevelDistribution(**settings_)

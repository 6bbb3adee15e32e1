"""Averages against the recurrence in float64."""

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.training.trainer.loop.ema import WeightAverages, warmed_decay


def test_decay_begins_at_nothing_and_is_capped() -> None:
    assert warmed_decay(0, 0.9999) == 0
    assert warmed_decay(15, 0.9999) == pytest.approx(1 - 16**-0.75)
    assert warmed_decay(10**9, 0.9999) == 0.9999


def test_averages_follow_the_recurrence() -> None:
    weight = torch.randn(5)
    averages = WeightAverages({"body.weight": weight}, cap=0.5)
    expected = weight.double()
    for step in range(12):
        weight.add_(torch.randn(5))
        averages.update()
        decay = min(0.5, 1 - (1 + step) ** -0.75)
        expected = decay * expected + (1 - decay) * weight.double()
    torch.testing.assert_close(
        averages.averages["body.weight"].double(), expected, rtol=1e-6, atol=1e-6
    )
    assert averages.updates == {"body": 12}


def test_swapping_is_exact_both_ways_even_after_an_error() -> None:
    weight = torch.randn(7)
    averages = WeightAverages({"body.weight": weight}, cap=0.9)
    before = weight.clone()
    weight.add_(0.1)
    now = weight.clone()
    with pytest.raises(ZeroDivisionError), averages.swapped():
        assert torch.equal(weight, before)
        raise ZeroDivisionError
    assert torch.equal(weight, now)
    assert torch.equal(averages.averages["body.weight"], before)


def test_restarted_parts_count_from_nothing() -> None:
    weights = {"body.weight": torch.ones(1), "head.weight": torch.ones(1)}
    averages = WeightAverages(weights, cap=0.9)
    averages.update()
    weights["head.weight"].fill_(5)
    averages.restart({"head", "elsewhere"})
    assert averages.updates == {"body": 1, "head": 0}
    assert averages.averages["head.weight"].item() == 5


@pytest.mark.parametrize("cap", [-0.1, 1.0])
def test_a_decay_out_of_range_is_refused(cap: float) -> None:
    with pytest.raises(ConfigError, match="expected at least 0 and below 1"):
        WeightAverages({}, cap)

"""Weights that are drawn one at a time are those that are drawn all at once."""

import pytest
import torch
from torch import nn

from diff4splat.errors import ConfigError
from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks, plan_networks
from diff4splat.models.networks import PARTS, model_parts
from diff4splat.models.placement.initial_weights import RecordedCalls, initial_weights


@pytest.mark.parametrize("config", [tiny_size(), small_size()], ids=["test", "small"])
def test_every_part_gets_the_same_bits(config) -> None:
    networks, weights = plan_networks(config, set(PARTS), seed=3)
    assert all(value.is_meta for _, part in networks.parts() for value in part.parameters())
    whole = dict(create_networks(config, seed=3).parts())
    assert set(whole) == set(model_parts(config))
    for part, network in whole.items():
        drawn = {name: value.clone() for name, value in weights[part].draw()}
        torch.testing.assert_close(drawn, dict(network.state_dict()), rtol=0, atol=0)


def test_only_one_weight_is_alive_at_a_time() -> None:
    _, weights = plan_networks(tiny_size(), {"ldrm"})
    alive = []
    for _, value in weights["ldrm"].draw():
        alive.append(torch.utils.weak.WeakTensorKeyDictionary({value: 1}))
        del value
        assert sum(map(len, alive)) <= 1


def test_the_random_state_of_the_caller_is_left_alone() -> None:
    _, weights = plan_networks(tiny_size(), {"dit"})
    torch.manual_seed(1)
    want = torch.rand(3)
    torch.manual_seed(1)
    for number, _ in enumerate(weights["dit"].draw()):
        if number == 5:
            assert torch.equal(torch.rand(3), want)


def test_values_that_come_another_way_are_refused() -> None:
    with torch.device("meta"), RecordedCalls() as recorded:
        layer = nn.Linear(2, 2)
        layer.scale = nn.Parameter(torch.arange(3.0))
    with pytest.raises(ConfigError, match="scale"):
        initial_weights(layer, recorded.calls, 0)

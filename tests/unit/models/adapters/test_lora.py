"""LoRA: a fresh one changes nothing, only it learns, and a merged one is the same network."""

import pytest
import torch
from oracles_models import randomised
from torch import nn

from diff4splat.errors import ConfigError
from diff4splat.models.adapters.lora import LoraLinear, add_lora, lora_weights, merged
from diff4splat.models.adapters.tuning import learns, prepare_tuning
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_dit.dit import VideoDiT


def dit() -> VideoDiT:
    torch.manual_seed(0)
    return randomised(VideoDiT(tiny_size()))


def inputs() -> tuple[torch.Tensor, ...]:
    generator = torch.Generator().manual_seed(1)
    latent = torch.randn(1, 4, 2, 4, 4, generator=generator)
    camera = torch.randn(1, 6, 5, 32, 32, generator=generator)
    text = torch.randn(1, 3, tiny_size().text.width, generator=generator)
    return latent, torch.full((1, 2), 0.5), camera, text


def spread_lora(network: nn.Module) -> None:
    with torch.no_grad():
        for name, value in network.named_parameters():
            if ".lora_" in name:
                value.normal_(0, 0.3)


@torch.no_grad()
def test_a_fresh_correction_changes_no_bit() -> None:
    network = dit()
    before = network(*inputs())
    assert add_lora(network, rank=3) == 2 * 2 * 4, "four layers of two attentions in two blocks"
    assert torch.equal(network(*inputs()), before)


@torch.no_grad()
def test_a_merged_network_is_the_unmerged_one() -> None:
    network = dit()
    add_lora(network, rank=3)
    fresh = network(*inputs())
    spread_lora(network)
    want, plain = network(*inputs()), dit()
    plain.load_state_dict(merged(network.state_dict()))
    assert not torch.allclose(want, fresh, atol=1e-3), "the correction matters"
    torch.testing.assert_close(plain(*inputs()), want, rtol=1e-5, atol=1e-5)


def test_merging_follows_the_formula() -> None:
    layer = LoraLinear(nn.Linear(5, 7), rank=2).double()
    spread = {key: torch.randn_like(value) for key, value in layer.state_dict().items()}
    layer.load_state_dict(spread)
    plain = merged({f"a.{key}": value for key, value in layer.state_dict().items()})
    assert set(plain) == {"a.weight", "a.bias"}
    tokens = torch.randn(3, 5, dtype=torch.float64)
    torch.testing.assert_close(tokens @ plain["a.weight"].mT + plain["a.bias"], layer(tokens))


def test_weights_without_corrections_pass_unchanged() -> None:
    state = dit().state_dict()
    assert merged(state).keys() == state.keys()


@pytest.mark.parametrize("tuning", ["adapters", "lora"])
def test_only_what_was_added_learns(tuning: str) -> None:
    network = dit()
    plain = set(network.state_dict())
    prepare_tuning(network, tuning, rank=2)
    names = [name for name, _ in network.named_parameters() if learns(network, name)]
    assert names
    assert all(".lora_" in name or name.startswith("camera_adapter.") for name in names)
    assert any(".lora_" in name for name in names) == (tuning == "lora")
    assert plain == set(merged(network.state_dict()))


def test_all_learn_by_default() -> None:
    network = dit()
    prepare_tuning(network, "full", rank=2)
    assert all(learns(network, name) for name, _ in network.named_parameters())


def test_what_is_stored_of_a_correction_is_small() -> None:
    network = dit()
    add_lora(network, rank=2)
    assert len(lora_weights(network.state_dict())) == 16 * 3


@pytest.mark.parametrize("rank", [0, -1])
def test_a_rank_below_one_is_refused(rank: int) -> None:
    with pytest.raises(ConfigError, match="lora_rank"):
        add_lora(dit(), rank)


def test_a_network_without_attention_is_refused() -> None:
    with pytest.raises(ConfigError, match="to_query"):
        add_lora(nn.Sequential(nn.Linear(2, 2)), 1)

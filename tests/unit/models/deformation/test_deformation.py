import dataclasses

import oracles_models as oracle
import pytest
import torch

from diff4splat.models.blocks.resize import upsample_bilinear
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.deformation.network import DeformationNetwork


def with_stride(stride: int) -> ModelConfig:
    config = tiny_size()
    return dataclasses.replace(config, ldrm=dataclasses.replace(config.ldrm, grid_stride=stride))


def trained(stride: int = 1) -> DeformationNetwork:
    return oracle.randomised(DeformationNetwork(with_stride(stride))).requires_grad_(False)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("frames", [1, 2, 3])
def test_shapes(stride: int, frames: int) -> None:
    network = DeformationNetwork(with_stride(stride))
    raw = network(torch.randn(2, 24, frames, 1, 3), torch.tensor([0.0, 1.0]))
    assert raw.shape == (2, 10, 4 * frames - 3, 16 // stride, 48 // stride)


def test_fresh_network_is_the_identity() -> None:
    network = DeformationNetwork(tiny_size())
    assert network.is_identity()
    assert not network(torch.randn(1, 24, 2, 2, 2), torch.tensor([0.7])).any()


@pytest.mark.parametrize("level", range(4))
@pytest.mark.parametrize("name", ["weight", "bias"])
def test_any_weight_in_a_last_layer_ends_the_identity(level: int, name: str) -> None:
    network = DeformationNetwork(tiny_size())
    with torch.no_grad():
        getattr(network.heads[level], name).view(-1)[-1] = 1e-20
    assert not network.is_identity()


def test_trained_network_moves_differently_at_other_times() -> None:
    network, tokens = trained(), torch.randn(1, 24, 2, 2, 2)
    early, late = network(tokens, torch.tensor([0.1])), network(tokens, torch.tensor([0.9]))
    assert (early - late).abs().mean() > 1e-3


def test_fresh_blocks_do_not_know_the_time() -> None:
    network = DeformationNetwork(tiny_size())
    for head in network.heads:
        torch.nn.init.normal_(head.weight)
    tokens = torch.randn(1, 24, 2, 2, 2)
    early, late = network(tokens, torch.tensor([0.1])), network(tokens, torch.tensor([0.9]))
    torch.testing.assert_close(early, late, atol=0, rtol=0)
    assert early.abs().mean() > 1e-3


def test_own_time_of_a_frame_matters() -> None:
    network = trained()
    tokens = torch.randn(1, 24, 1, 1, 1).expand(1, 24, 2, 1, 1)
    raw = network(tokens, torch.tensor([0.5]))
    assert (raw[:, :, 0] - raw[:, :, 4]).abs().max() > 1e-3


def test_a_frame_is_moved_by_its_own_token() -> None:
    network, tokens = trained(), torch.randn(1, 24, 3, 1, 1)
    other = tokens.clone()
    other[:, :, 1] += 1
    time = torch.tensor([0.5])
    moved = (network(tokens, time) - network(other, time)).abs().amax((0, 1, 3, 4)) > 0
    assert moved.nonzero().flatten().tolist() == [1, 2, 3, 4]


def test_sum_over_levels_is_one_convolution_over_stacked_levels() -> None:
    network = trained().double()
    tokens = torch.randn(1, 24, 1, 1, 2, dtype=torch.float64)
    time = torch.tensor([0.3], dtype=torch.float64)
    features = network._tokens_at(tokens, time)[0].permute(0, 3, 1, 2)
    total = torch.zeros(10, 16, 32, dtype=torch.float64)
    for index, head in enumerate(network.heads):
        image = features[-1]
        for scale in [2] * (3 - index) + [2]:
            image = oracle.upsampled_bilinear(image, scale)
        total += (
            torch.einsum("oc,chw->ohw", head.weight[:, :, 0, 0], image) + head.bias[:, None, None]
        )
        if index < 3:
            features = network.levels[index](features)
    torch.testing.assert_close(network(tokens, time)[0, :, 0], total)


@pytest.mark.parametrize("scale", [1, 2, 4])
def test_upsampling_matches_a_loop(scale: int) -> None:
    maps = torch.randn(1, 2, 3, 4, dtype=torch.float64)
    torch.testing.assert_close(
        upsample_bilinear(maps, scale)[0], oracle.upsampled_bilinear(maps[0], scale)
    )


def test_batch_elements_have_their_own_time() -> None:
    network, tokens = trained(), torch.randn(2, 24, 2, 1, 1)
    both = network(tokens, torch.tensor([0.2, 0.6]))
    for item, time in enumerate((0.2, 0.6)):
        single = network(tokens[item : item + 1], torch.tensor([time]))
        torch.testing.assert_close(both[item : item + 1], single, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("scale", [0.0, 1e6])
@pytest.mark.parametrize("time", [0.0, 1.0])
def test_extremes_stay_finite(scale: float, time: float) -> None:
    tokens = (torch.randn(1, 24, 1, 1, 1) * scale).requires_grad_()
    raw = trained()(tokens, torch.tensor([time]))
    raw.sum().backward()
    assert torch.isfinite(raw).all() and torch.isfinite(tokens.grad).all()


def test_gradient_reaches_every_weight() -> None:
    network = oracle.randomised(DeformationNetwork(tiny_size()))
    network(torch.randn(1, 24, 2, 2, 2), torch.tensor([0.4])).square().sum().backward()
    assert all(p.grad.abs().sum() > 0 for p in network.parameters())

"""Zero-initialised layers must not block learning: after a few steps every weight has moved."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from diff4splat.models.config.priors import MonocularDepthConfig, MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks

STEPS = 8


def dit_output(network: nn.Module) -> Tensor:
    latent, level = torch.randn(1, 4, 2, 4, 4), torch.rand(1, 2)
    return network(latent, level, torch.randn(1, 6, 5, 32, 32), torch.randn(1, 3, 16))


def ldrm_output(network: nn.Module) -> Tensor:
    return network(torch.randn(1, 4, 2, 4, 4), torch.randn(1, 6, 5, 32, 32)).gaussians


def deformation_output(network: nn.Module) -> Tensor:
    return network(torch.randn(1, 24, 2, 2, 2), torch.rand(1))


def depth_output(network: nn.Module) -> Tensor:
    return network(torch.rand(1, 3, 32, 32))


def motion_output(network: nn.Module) -> Tensor:
    mask = torch.tensor([[True] * 3, [False] * 3])
    noise, level = torch.randn(2, 3, 2, 8, 8), torch.rand(2)
    outputs = network.predict_motion_and_mask(
        torch.rand(2, 3, 32, 32), noise, level, torch.randn(2, 3, 16), mask
    )
    return torch.cat([output.flatten() for output in outputs])


CONFIG = replace(
    tiny_size(),
    monocular_depth=MonocularDepthConfig(channels=4),
    motion_unet=MotionUNetConfig(width=8, mask_refiner_width=4),
)
OUTPUTS = {
    "dit": dit_output,
    "ldrm": ldrm_output,
    "deformation": deformation_output,
    "monocular_depth": depth_output,
    "motion_unet": motion_output,
}


@pytest.mark.parametrize(("part", "output"), OUTPUTS.items(), ids=OUTPUTS)
def test_training_changes_every_weight(part: str, output: Callable[[nn.Module], Tensor]) -> None:
    network = getattr(create_networks(CONFIG), part)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-2)
    for _ in range(STEPS):
        optimiser.zero_grad()
        out = output(network)
        (out - torch.randn_like(out)).square().mean().backward()
        optimiser.step()
    unchanged = [
        name for name, value in network.state_dict().items() if torch.equal(value, before[name])
    ]
    assert unchanged == []

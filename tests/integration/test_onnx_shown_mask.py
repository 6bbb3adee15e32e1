"""The graph of a motion network that is shown the mask of an object, beside PyTorch."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx_parts import exported_part

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.priors import MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model


def config() -> ModelConfig:
    motion = MotionUNetConfig(width=8, heads=1, object_mask=True)
    return replace(tiny_size(), motion_unet=motion)


@pytest.mark.slow
def test_motion_is_that_of_the_network_with_a_mask_and_without(tmp_path: Path) -> None:
    networks = create_networks(config())
    for parameter in networks.motion_unet.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    model = Model(config=config(), networks=networks)
    graph = exported_part(model, tmp_path, "motion_unet", ("motion", "mask_logits"))
    given = (torch.rand(2, 3, 32, 48), torch.randn(2, 3, 2, 8, 12), torch.ones(2))
    text, mask = torch.randn(2, 4, config().text.width), torch.rand(2, 32, 48)
    found = []
    for shown in (mask, None):
        with torch.no_grad():
            found.append(graph(*given, text, None, shown))
            wanted = networks.motion_unet(*given, text, None, shown)
        torch.testing.assert_close(found[-1], wanted, atol=1e-4, rtol=1e-3)
    assert not torch.allclose(*found, atol=1e-3)

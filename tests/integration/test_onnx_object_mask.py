"""The graph of an object mask with vectors of instances, beside PyTorch."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx_parts import exported_part

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.priors import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model

CHANNELS = 3


def config() -> ModelConfig:
    mask = ObjectMaskConfig(width=4, instance_channels=CHANNELS)
    motion = MotionUNetConfig(width=8, heads=1)
    return replace(tiny_size(), motion_unet=motion, object_mask=mask)


@pytest.mark.slow
def test_mask_and_instances_are_those_of_the_network(tmp_path: Path) -> None:
    model = Model(config=config(), networks=create_networks(config()))
    image, text = torch.rand(1, 3, 32, 48), torch.randn(1, 4, config().text.width)
    graph = exported_part(model, tmp_path, "object_mask", ("mask_logits", "instances"))
    with torch.no_grad():
        found = graph.predict_mask_and_instances(image, text)
        wanted = model.networks.object_mask.predict_mask_and_instances(image, text)
    assert found[1].shape == (1, CHANNELS + 1, 32, 48)
    for one, other in zip(found, wanted, strict=True):
        torch.testing.assert_close(one, other, atol=1e-4, rtol=1e-3)

"""The graph of an object shadow beside PyTorch, with other sizes than it was traced with."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx_parts import exported_part

from diff4splat.models.config.priors import ObjectShadowConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model

CONFIG = replace(tiny_size(), object_shadow=ObjectShadowConfig(width=4))


@pytest.mark.slow
def test_darkening_is_that_of_the_network(tmp_path: Path) -> None:
    networks = create_networks(CONFIG)
    torch.nn.init.normal_(networks.object_shadow.head.weight, std=0.5)
    model = Model(config=CONFIG, networks=networks)
    graph = exported_part(model, tmp_path, "object_shadow", ("darkening",))
    image, mask = torch.rand(2, 3, 48, 80), torch.zeros(2, 48, 80)
    mask[:, 10:30, 20:50] = 1
    with torch.no_grad():
        found, wanted = graph(image, mask), networks.object_shadow(image, mask)
    assert wanted.any()
    torch.testing.assert_close(found, wanted, atol=1e-3, rtol=1e-3)

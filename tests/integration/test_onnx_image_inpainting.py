"""The graph of image inpainting beside PyTorch, with other sizes than it was traced with."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx_parts import exported_part

from diff4splat.generation.layered_image.inpainting import NetworkInpainting
from diff4splat.models.config.priors import ImageInpaintingConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model

CONFIG = replace(tiny_size(), image_inpainting=ImageInpaintingConfig(widths=(4, 6, 8, 8)))


@pytest.mark.slow
def test_completed_images_are_those_of_the_network(tmp_path: Path) -> None:
    networks = create_networks(CONFIG)
    model = Model(config=CONFIG, networks=networks)
    graph = exported_part(model, tmp_path, "image_inpainting", ("completed",))
    generator = torch.Generator().manual_seed(0)
    rgb = torch.rand(21, 43, 3, generator=generator)
    known = torch.rand(21, 43, generator=generator) < 0.5
    assert graph.multiple_px == networks.image_inpainting.multiple_px == 8
    found, wanted = (
        NetworkInpainting(network=network)(rgb, known)
        for network in (graph, networks.image_inpainting)
    )
    assert not torch.equal(wanted, rgb)
    torch.testing.assert_close(found, wanted, atol=1e-3, rtol=1e-3)

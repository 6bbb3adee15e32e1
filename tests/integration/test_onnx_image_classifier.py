"""The graph of an image classifier beside PyTorch, with other sizes than it was traced with."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx_parts import exported_part

from diff4splat.captions.image_classes.class_nouns import class_rows
from diff4splat.models.config.priors import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model

CONFIG = replace(
    tiny_size(),
    motion_unet=MotionUNetConfig(width=8, heads=1),
    object_mask=ObjectMaskConfig(width=4, image_classifier=True),
)


@pytest.mark.slow
def test_corrected_logits_are_those_of_the_network(tmp_path: Path) -> None:
    networks = create_networks(CONFIG)
    torch.nn.init.normal_(networks.image_classifier.output.weight, std=0.5)
    model = Model(config=CONFIG, networks=networks)
    graph = exported_part(model, tmp_path, "image_classifier", ("corrected_logits",))
    image, logits = torch.rand(1, 3, 48, 80), torch.randn(1, 2, 48, 80)
    classes = class_rows([tuple(range(600)), ()])[None]
    with torch.no_grad():
        found = graph(image, logits, classes)
        wanted = networks.image_classifier(image, logits, classes)
    assert not torch.equal(wanted, logits)
    torch.testing.assert_close(found, wanted, atol=1e-3, rtol=1e-3)

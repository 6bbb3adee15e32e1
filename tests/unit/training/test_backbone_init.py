"""Public weights of the image backbone as the start of a stage."""

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.models.image_backbone.efficientnet_lite import EfficientNetLite
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.networks import Networks
from diff4splat.training import backbone_init


def test_only_the_backbone_takes_public_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(1)
    public = EfficientNetLite().state_dict()
    monkeypatch.setattr(backbone_init, "public_backbone_weights", lambda: public)
    network = BackboneDepthNet(4)
    before = {key: value.clone() for key, value in network.state_dict().items()}
    networks = Networks(monocular_depth=network)
    backbone_init.start_from_public_backbones(networks, ["monocular_depth"])
    for key, value in network.state_dict().items():
        name = key.removeprefix("backbone.")
        want = public[name] if key.startswith("backbone.") else before[key]
        torch.testing.assert_close(value, want)


def test_a_part_without_a_backbone_is_refused() -> None:
    networks = Networks(monocular_depth=MonocularDepthNet(4))
    with pytest.raises(ConfigError, match=r"monocular_depth.*image_backbone"):
        backbone_init.start_from_public_backbones(networks, ["monocular_depth"])
    backbone_init.start_from_public_backbones(networks, [])

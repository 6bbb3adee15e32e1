"""What the depth prior knows about its errors, beside its depth."""

import pytest
import torch
from torch import nn

from diff4splat.errors import ConfigError
from diff4splat.models.config.priors import MonocularDepthConfig
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.monocular_depth.uncertainty import LOG_LIMITS, UncertaintyHead


def network(seed: int = 0) -> BackboneDepthNet:
    torch.manual_seed(seed)
    made = BackboneDepthNet(4, uncertainty=True)
    for one in (made.head, made.unet.head, made.uncertainty.head):
        nn.init.normal_(one.weight, std=0.1)
    return made


def test_it_comes_with_the_distance_of_every_encoder() -> None:
    made, image = network(), torch.rand(2, 3, 32, 64)
    distance, log_scale = made.predict_distance_and_uncertainty(image)
    assert distance.shape == (2, 2, 32, 64) and log_scale.shape == (2, 1, 32, 64)
    torch.testing.assert_close(distance.mean(1, keepdim=True), made(image))
    torch.testing.assert_close(distance[:, 1:], made.unet(image))
    assert float(log_scale.detach().std()) > 0


def test_a_network_without_the_head_has_the_same_depth_and_no_uncertainty() -> None:
    made, image = network(), torch.rand(1, 3, 32, 32)
    plain = BackboneDepthNet(4)
    kept = {key: value for key, value in made.state_dict().items() if key in plain.state_dict()}
    plain.load_state_dict(kept)
    distance, log_scale = plain.predict_distance_and_uncertainty(image)
    assert log_scale is None
    assert torch.equal(distance, made.predict_distance_and_uncertainty(image)[0])
    assert MonocularDepthNet(4).predict_distance_and_uncertainty(image)[1] is None


def test_depth_learns_nothing_from_it() -> None:
    made = network()
    made.predict_distance_and_uncertainty(torch.rand(1, 3, 32, 32))[1].sum().backward()
    learnt = {name for name, one in made.named_parameters() if one.grad is not None}
    assert learnt and all(name.startswith("uncertainty.") for name in learnt)


def test_a_fresh_head_says_that_it_knows_nothing() -> None:
    found = UncertaintyHead(6)(torch.rand(1, 6, 4, 4))
    assert found.shape == (1, 1, 8, 8) and bool((found == 0).all())


@pytest.mark.parametrize("size", [0.0, 1e-30, 1e18])
def test_extreme_features_have_a_finite_uncertainty(size: float) -> None:
    head = UncertaintyHead(2)
    nn.init.ones_(head.head.weight)
    found = head(torch.full((1, 2, 4, 4), size))
    assert bool((found >= LOG_LIMITS[0]).all()) and bool((found <= LOG_LIMITS[1]).all())


def test_it_needs_the_image_backbone() -> None:
    with pytest.raises(ConfigError, match="uncertainty: expected false without the image backbone"):
        MonocularDepthConfig(channels=4, uncertainty=True)

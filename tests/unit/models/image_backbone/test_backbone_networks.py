"""Depth prior and object mask on the image backbone."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from diff4splat.models.config.priors import MonocularDepthConfig, MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size
from diff4splat.models.factory import parameter_counts
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.mask_heads import HeadShape
from diff4splat.models.object_mask.network import ObjectMaskNet

WIDTH, TEXT_WIDTH = 4, 8
SHAPE = HeadShape(width=WIDTH, text_width=TEXT_WIDTH)


def depth() -> nn.Module:
    torch.manual_seed(0)
    network = BackboneDepthNet(WIDTH)
    torch.nn.init.normal_(network.head.weight, std=0.1)
    return network


def masks() -> nn.Module:
    torch.manual_seed(0)
    network = BackboneObjectMaskNet(SHAPE)
    text = torch.rand(2, 5, TEXT_WIDTH)
    # One prompt for every image, so that both networks are called with images alone.
    network.register_forward_pre_hook(
        lambda _, images: (*images, text[: len(images[0])].to(images[0]))
    )
    return network


def _last(weight: Tensor, like: Tensor) -> Tensor:
    """The input channels of the U-Net, which come last."""
    return weight if weight.shape == like.shape else weight[:, -like.shape[1] :]


NETWORKS = pytest.mark.parametrize("make", [depth, masks])


def test_a_fresh_network_predicts_the_plane() -> None:
    assert bool((BackboneDepthNet(WIDTH)(torch.rand(1, 3, 32, 64)) == 0).all())


def test_the_configuration_decides_the_size_of_the_backbone() -> None:
    counts = []
    for size in ("lite0", "lite2"):
        on = {"image_backbone": True, "backbone_size": size}
        depth = MonocularDepthConfig(channels=WIDTH, **on)
        motion, mask = MotionUNetConfig(width=8), ObjectMaskConfig(width=WIDTH, **on)
        config = replace(test_size(), monocular_depth=depth, motion_unet=motion, object_mask=mask)
        counts.append(parameter_counts(config))
    for part in ("monocular_depth", "object_mask"):
        assert counts[0][part] < counts[1][part]
    assert counts[0]["ldrm"] == counts[1]["ldrm"]


def test_depth_is_the_mean_of_both_encoders() -> None:
    network, image = depth(), torch.rand(1, 3, 32, 64)
    torch.nn.init.normal_(network.unet.head.weight, std=0.1)
    both, unet = network(image), network.unet(image)
    torch.nn.init.zeros_(network.unet.head.weight)
    torch.testing.assert_close(both, network(image) + unet / 2)
    assert bool((unet != 0).any())


def test_a_mask_without_the_backbones_features_is_that_of_the_unet() -> None:
    both, alone = BackboneObjectMaskNet(SHAPE), ObjectMaskNet(SHAPE)
    torch.nn.init.zeros_(both.embedding.weight[:, :WIDTH])
    weights = both.unet.state_dict()
    for name in ("embedding", "queries", "names"):
        alone.get_submodule(name).load_state_dict(
            {
                key: _last(weight, like)
                for (key, weight), like in zip(
                    both.get_submodule(name).state_dict().items(),
                    alone.get_submodule(name).state_dict().values(),
                    strict=True,
                )
            }
        )
    alone.load_state_dict(weights, strict=False)
    image, text = torch.rand(2, 3, 32, 64), torch.rand(2, 5, TEXT_WIDTH)
    torch.testing.assert_close(both(image, text), alone(image, text))


@NETWORKS
@pytest.mark.parametrize("size", [(32, 32), (64, 32)])
def test_every_pixel_of_any_multiple_has_a_value(
    make: Callable[[], nn.Module], size: tuple[int, int]
) -> None:
    values = make()(torch.rand(2, 3, *size))
    assert values.shape[-2:] == size and bool(values.isfinite().all())


@NETWORKS
def test_every_weight_but_those_of_names_has_a_finite_gradient(
    make: Callable[[], nn.Module],
) -> None:
    network = make()
    network(torch.rand(2, 3, 64, 64)).square().mean().backward()
    for name, weight in network.named_parameters():
        if name.startswith("names."):
            continue
        assert weight.grad is not None and bool(weight.grad.isfinite().all()), name


@NETWORKS
def test_gradcheck(make: Callable[[], nn.Module]) -> None:
    network = make().double()
    image = torch.rand(1, 3, 32, 32, dtype=torch.float64, requires_grad=True)
    # A fast check compares one random direction: thousands of inputs one by one take minutes.
    assert torch.autograd.gradcheck(network, (image,), fast_mode=True)


@NETWORKS
@pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
def test_extremes_are_finite(make: Callable[[], nn.Module], value: float) -> None:
    image = torch.full((1, 3, 32, 32), value, requires_grad=True)
    values = make()(image)
    values.sum().backward()
    assert bool(values.isfinite().all()) and bool(image.grad.isfinite().all())


@NETWORKS
def test_images_of_a_batch_do_not_affect_each_other(make: Callable[[], nn.Module]) -> None:
    network, image = make(), torch.rand(1, 3, 32, 32)
    twice = network(image.repeat(2, 1, 1, 1))[0]
    torch.testing.assert_close(twice, network(image)[0], atol=1e-5, rtol=1e-5)

"""The depth prior: the raw ray distance of every pixel of one image."""

import pytest
import torch

from diff4splat.models.image_unet.cells import MULTIPLE_PX
from diff4splat.models.image_unet.network import pixel_coordinates
from diff4splat.models.monocular_depth.network import MonocularDepthNet


def network() -> MonocularDepthNet:
    torch.manual_seed(0)
    result = MonocularDepthNet(4)
    torch.nn.init.normal_(result.head.weight, std=0.1)
    return result


def test_a_fresh_network_predicts_the_plane() -> None:
    assert bool((MonocularDepthNet(4)(torch.rand(2, 3, 32, 48)) == 0).all())


@pytest.mark.parametrize("size", [(16, 16), (64, 32), (16, 96)])
def test_every_pixel_of_any_multiple_has_a_distance(size: tuple[int, int]) -> None:
    assert size[0] % MULTIPLE_PX == size[1] % MULTIPLE_PX == 0
    distance = network()(torch.rand(2, 3, *size))
    assert distance.shape == (2, 1, *size) and bool(distance.isfinite().all())


def test_every_weight_has_a_finite_gradient() -> None:
    trained = network()
    trained(torch.rand(1, 3, 32, 32)).square().mean().backward()
    for name, weight in trained.named_parameters():
        assert weight.grad is not None and bool(weight.grad.isfinite().all()), name
        assert bool((weight.grad != 0).any()), name


def test_gradcheck() -> None:
    trained = network().double()
    image = torch.rand(1, 3, 16, 16, dtype=torch.float64, requires_grad=True)
    # A fast check compares one random direction: 768 inputs one by one would take a minute.
    assert torch.autograd.gradcheck(trained, (image,), fast_mode=True)


@pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
def test_extremes_are_finite(value: float) -> None:
    image = torch.full((1, 3, 16, 16), value, requires_grad=True)
    distance = network()(image)
    distance.sum().backward()
    assert bool(distance.isfinite().all()) and bool(image.grad.isfinite().all())


def test_images_of_a_batch_do_not_affect_each_other() -> None:
    trained, images = network(), torch.rand(3, 3, 32, 32)
    alone = torch.cat([trained(image[None]) for image in images])
    torch.testing.assert_close(trained(images), alone, atol=1e-5, rtol=1e-5)


def test_pixel_coordinates_run_from_edge_to_edge() -> None:
    x, y = pixel_coordinates(torch.zeros(2, 3, 2, 4))[1]
    torch.testing.assert_close(x, torch.tensor([[-0.75, -0.25, 0.25, 0.75]] * 2))
    torch.testing.assert_close(y, torch.tensor([[-0.5] * 4, [0.5] * 4]))


def test_position_matters() -> None:
    distance = network()(torch.full((1, 3, 64, 64), 0.5))[0, 0, 24:40, 24:40]
    assert len(distance.detach().unique()) > 200

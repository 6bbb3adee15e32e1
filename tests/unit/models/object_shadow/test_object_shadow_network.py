"""The object shadow: zero when fresh, coordinates in the object's own size, finite everywhere."""

import pytest
import torch

from diff4splat.models.object_shadow.network import REACH, ObjectShadowNet, object_coordinates


def network(width: int = 4) -> ObjectShadowNet:
    torch.manual_seed(0)
    made = ObjectShadowNet(width)
    torch.nn.init.normal_(made.head.weight, std=0.5)
    return made


def mask(top: int, left: int, side: int, size: int = 48) -> torch.Tensor:
    pixels = torch.zeros(1, size, size)
    pixels[0, top : top + side, left : left + side] = 1
    return pixels


def test_a_fresh_network_sees_no_shadow() -> None:
    found = ObjectShadowNet(4)(torch.rand(2, 3, 32, 48), torch.rand(2, 32, 48))
    assert found.shape == (2, 3, 32, 48)
    assert not found.any()


def test_the_mask_says_whose_shadow() -> None:
    image, net = torch.rand(1, 3, 48, 48), network()
    first, second = net(image, mask(4, 4, 8)), net(image, mask(30, 30, 8))
    assert not torch.allclose(first, second, atol=1e-3)


@pytest.mark.parametrize("factor", [1, 2])
def test_coordinates_are_those_of_the_object_whatever_its_size(factor: int) -> None:
    small = object_coordinates(mask(8, 20, 6))[0]
    large = object_coordinates(mask(8 * factor, 20 * factor, 6 * factor, 48 * factor))[0]
    reduced = torch.nn.functional.avg_pool2d(large[None], factor)[0]
    inside = (small > 0.05) & (small < 0.95)
    assert torch.allclose(small[inside], reduced[inside], atol=6e-3)


def test_coordinates_are_those_of_the_formula() -> None:
    pixels = mask(8, 20, 6).double()
    found = object_coordinates(pixels)[0]
    axis = (2 * torch.arange(48).double() + 1) / 48 - 1
    columns, rows = axis[20:26], axis[8:14]
    spread = (columns.var(unbiased=False) + rows.var(unbiased=False)).sqrt()
    wanted = ((axis - columns.mean()) / (REACH * spread)).clamp(-1, 1) / 2 + 0.5
    assert torch.allclose(found[0], wanted.expand(48, 48), atol=3e-3)


@pytest.mark.parametrize("pixels", [mask(0, 0, 0), mask(3, 5, 1), torch.ones(1, 48, 48)])
def test_any_mask_gives_finite_values_and_gradients(pixels: torch.Tensor) -> None:
    image = torch.rand(1, 3, 48, 48, requires_grad=True)
    found = network()(image, pixels)
    found.sum().backward()
    assert bool(found.isfinite().all()) and bool(image.grad.isfinite().all())

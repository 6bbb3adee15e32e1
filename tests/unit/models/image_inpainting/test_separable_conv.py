"""Resampling of MI-GAN against its definition, and gradients."""

import pytest
import torch
from torch import Tensor
from torch.nn.functional import conv2d

from diff4splat.models.image_inpainting.separable_conv import (
    SeparableConv,
    activated,
    doubled,
    halved,
)


def states(height: int, width: int, channels: int = 3) -> Tensor:
    generator = torch.Generator().manual_seed(height + width)
    return torch.randn(2, channels, height, width, generator=generator, dtype=torch.float64)


def binomial(channels: int) -> Tensor:
    row = torch.tensor([1.0, 3.0, 3.0, 1.0], dtype=torch.float64) / 8
    return torch.outer(row, row).expand(channels, 1, 4, 4)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (3, 5), (8, 4)])
def test_doubling_puts_zeros_between_and_filters(height: int, width: int) -> None:
    given = states(height, width)
    apart = given.new_zeros(2, 3, 2 * height, 2 * width)
    apart[..., ::2, ::2] = given
    wanted = conv2d(torch.nn.functional.pad(apart, (2, 1, 2, 1)), 4 * binomial(3), groups=3)
    torch.testing.assert_close(doubled(given), wanted)


@pytest.mark.parametrize(("height", "width"), [(2, 2), (6, 10)])
def test_halving_filters_and_takes_every_second(height: int, width: int) -> None:
    given = states(height, width)
    around = torch.nn.functional.pad(given, (1, 1, 1, 1))
    everywhere = conv2d(around, binomial(3), groups=3)
    torch.testing.assert_close(halved(given), everywhere[..., ::2, ::2])


def test_an_even_image_stays_even_inside() -> None:
    for found in (halved(torch.ones(1, 1, 8, 8)), doubled(torch.ones(1, 1, 4, 4))):
        torch.testing.assert_close(
            found[..., 1:-1, 1:-1], torch.ones(1, 1, *found[0, 0].shape)[..., 1:-1, 1:-1]
        )


def test_negative_states_keep_a_fifth() -> None:
    found = activated(torch.tensor([[[[-10.0, 0.0, 10.0]]]]))
    assert found.flatten().tolist() == [-2.0, 0.0, 10.0]


@pytest.mark.parametrize("resampling", ["none", "halved", "doubled"])
def test_gradients(resampling: str) -> None:
    torch.manual_seed(0)
    conv = SeparableConv(3, 2, resampling).double()
    assert torch.autograd.gradcheck(conv, states(4, 4).requires_grad_())

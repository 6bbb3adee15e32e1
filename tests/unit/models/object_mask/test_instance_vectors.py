"""Vectors of instances: distances against the formula, extremes, and place."""

import math

import pytest
import torch
from torch import Tensor

from diff4splat.models.object_mask.instance_head import (
    IMAGE_SIDE,
    LARGEST_LOG_SCALE,
    InstanceHead,
)
from diff4splat.models.object_mask.instance_vectors import (
    INSIDE_LOGIT,
    membership_logits,
    pair_logits,
)

CHANNELS = 3


def maps() -> Tensor:
    """Two images of 4 × 6 pixels."""
    torch.manual_seed(0)
    return torch.randn(2, CHANNELS + 1, 4, 6).double()


def seeds() -> Tensor:
    torch.manual_seed(1)
    return torch.rand(2, 5, 24).double().softmax(-1)


def test_logits_are_those_of_the_formula() -> None:
    given, weights = maps(), seeds()
    logits = membership_logits(given, weights)
    assert logits.shape == (2, 5, 4, 6)
    for image, seed, row, column in [(0, 0, 0, 0), (1, 3, 2, 5), (0, 4, 3, 1)]:
        flat, total = given[image].flatten(1), weights[image, seed]
        mean = [float((flat[k] * total).sum()) for k in range(CHANNELS + 1)]
        pixel = given[image, :CHANNELS, row, column].tolist()
        distance = sum((a - b) ** 2 for a, b in zip(pixel, mean, strict=False))
        expected = INSIDE_LOGIT - distance * math.exp(mean[-1])
        assert float(logits[image, seed, row, column]) == pytest.approx(expected)


def test_a_seed_of_one_pixel_is_surely_of_its_own_object() -> None:
    weights = torch.eye(24).double().expand(2, -1, -1)
    logits = membership_logits(maps(), weights).flatten(2)
    torch.testing.assert_close(
        logits.diagonal(dim1=1, dim2=2), torch.full((2, 24), INSIDE_LOGIT).double()
    )
    assert float(logits.max()) <= INSIDE_LOGIT + 1e-9


def test_gradients() -> None:
    given, weights = maps().requires_grad_(), seeds()
    assert torch.autograd.gradcheck(lambda x: membership_logits(x, weights), given)


@pytest.mark.parametrize("length", [0.0, 1e4, -1e4])
def test_extreme_vectors_are_finite(length: float) -> None:
    vectors = torch.full((6, CHANNELS), length, requires_grad=True)
    scales = torch.full((2,), LARGEST_LOG_SCALE)
    logits = pair_logits(vectors, torch.zeros(2, CHANNELS), scales)
    logits.sigmoid().sum().backward()
    assert bool(logits.isfinite().all()) and bool(vectors.grad.isfinite().all())


@torch.no_grad()
def test_a_head_without_weights_gives_the_place() -> None:
    head = InstanceHead(5, CHANNELS)
    torch.nn.init.zeros_(head.conv.weight)
    found = head(torch.randn(1, 5, 2, 4))
    assert found.shape == (1, CHANNELS + 1, 4, 8)
    assert float(found[0, 0].max() - found[0, 0].min()) == pytest.approx(IMAGE_SIDE * 7 / 8)
    # A pixel is as long in both directions, whatever the format.
    steps = found[0, 0, 0, 1] - found[0, 0, 0, 0], found[0, 1, 1, 0] - found[0, 1, 0, 0]
    assert float(steps[0]) == pytest.approx(IMAGE_SIDE / 8) == pytest.approx(float(steps[1]))
    assert not found[0, 2:].any()


@torch.no_grad()
def test_log_scales_are_bounded() -> None:
    head = InstanceHead(2, 2)
    torch.nn.init.constant_(head.conv.bias, 1e3)
    assert float(head(torch.zeros(1, 2, 2, 2))[0, -1].max()) == LARGEST_LOG_SCALE

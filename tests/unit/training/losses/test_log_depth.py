"""Losses of the depth of single images."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.training.losses.log_depth import (
    LEAST_PIXELS,
    SCALES,
    gradient_error,
    laplace_error,
    rescale_median,
)


def edge_oracle(difference: Tensor, known: Tensor) -> float:
    """The formula, pixel by pixel."""
    height, width = difference.shape
    total = 0.0
    for stride in (1 << scale for scale in range(SCALES)):
        for down, right in ((0, stride), (stride, 0)):
            steps = [
                abs(float(difference[y + down, x + right] - difference[y, x]))
                for y in range(height - down)
                for x in range(width - right)
                if known[y, x] and known[y + down, x + right]
            ]
            total += math.fsum(steps) / len(steps) if steps else 0.0
    return total


@given(st.integers(0, 20), st.integers(1, 12), st.integers(1, 12))
def test_edges_agree_with_the_formula(seed: int, height: int, width: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    difference = torch.randn(2, height, width, generator=generator, dtype=torch.float64)
    known = torch.rand(2, height, width, generator=generator) < 0.7
    wanted = [edge_oracle(*pair) for pair in zip(difference, known, strict=True)]
    found = gradient_error(difference, known)
    torch.testing.assert_close(found, found.new_tensor(wanted), atol=1e-10, rtol=1e-10)


def test_edges_do_not_ask_for_a_scale() -> None:
    difference = torch.randn(1, 8, 8, dtype=torch.float64)
    known = torch.ones(1, 8, 8, dtype=torch.bool)
    torch.testing.assert_close(
        gradient_error(difference + 3, known), gradient_error(difference, known)
    )
    assert float(gradient_error(torch.full_like(difference, 5.0), known)) == 0


@given(st.integers(0, 20))
def test_the_likelihood_of_an_error_agrees_with_the_formula(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    difference, log_scale = torch.randn(2, 2, 5, 6, generator=generator, dtype=torch.float64)
    known = torch.rand(2, 5, 6, generator=generator) < 0.7
    found = laplace_error(difference, log_scale, known)
    for place, value in enumerate(found):
        pairs = zip(difference[place][known[place]], log_scale[place][known[place]], strict=True)
        errors, logs = zip(*((float(d), float(s)) for d, s in pairs), strict=True)
        middle = sorted(errors)[(len(errors) - 1) // 2]
        each = [
            abs(error - middle) / math.exp(log) + log
            for error, log in zip(errors, logs, strict=True)
        ]
        assert float(value) == pytest.approx(math.fsum(each) / len(each))


def test_the_likelihood_teaches_the_scale_alone_and_is_best_at_the_mean_error() -> None:
    generator = torch.Generator().manual_seed(2)
    difference = torch.randn(1, 9, 9, generator=generator, dtype=torch.float64)
    known = torch.ones(1, 9, 9, dtype=torch.bool)
    error = (difference - difference.median()).abs().mean()
    log_scale = error.log().expand(1, 9, 9).clone().requires_grad_()
    given = difference.clone().requires_grad_()
    laplace_error(given, log_scale, known).sum().backward()
    assert given.grad is None and abs(float(log_scale.grad.sum())) < 1e-12
    start = torch.randn(1, 9, 9, generator=generator, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda s: laplace_error(difference, s, known), start)


@pytest.mark.parametrize("size", [0.0, 1e-30, 30.0])
def test_the_likelihood_of_extreme_errors_is_finite(size: float) -> None:
    difference = size * torch.randn(2, 8, 8)
    known = torch.ones(2, 8, 8, dtype=torch.bool)
    known[1], difference[0, 0, 0] = False, torch.nan
    known[0, 0, 0] = False
    for log in (-6.0, 2.0):
        log_scale = torch.full((2, 8, 8), log, requires_grad=True)
        found = laplace_error(difference, log_scale, known)
        found.nansum().backward()
        assert bool(found[0].isfinite()) and bool(log_scale.grad.isfinite().all())


def test_gradients_are_right_and_nothing_comes_from_hidden_pixels() -> None:
    generator = torch.Generator().manual_seed(1)
    difference = torch.randn(1, 6, 5, generator=generator, dtype=torch.float64)
    known = torch.rand(1, 6, 5, generator=generator) < 0.6
    difference[~known] = torch.nan
    difference.requires_grad_()
    gradient_error(difference, known).sum().backward()
    assert bool((difference.grad[~known] == 0).all()) and bool(difference.grad.isfinite().all())
    whole = torch.ones_like(known)
    smooth = torch.randn(1, 6, 5, generator=generator, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda d: gradient_error(d, whole), smooth)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_every_image_has_its_median_where_asked(unit: float) -> None:
    depth = unit * (1 + torch.rand(3, 8, 8, dtype=torch.float64))
    depth[1, :3] = 0
    scaled, known = rescale_median(depth, 4.0)
    for image, mask in zip(scaled, known, strict=True):
        assert float(image[mask].median()) == pytest.approx(4.0)
    assert not known[1, :3].any() and bool((scaled[1, :3] == 1).all())


def test_an_image_with_next_to_no_depth_says_nothing() -> None:
    depth = torch.zeros(2, 8, 8)
    depth[0].view(-1)[: LEAST_PIXELS - 1] = 2.0
    depth[1, 0, 0] = torch.inf
    scaled, known = rescale_median(depth, 4.0)
    assert not known.any() and bool((scaled == 1).all())
    assert bool((gradient_error(scaled.log(), known) == 0).all())

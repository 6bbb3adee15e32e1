import math

import oracles_losses as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.models.video_vae.vae import LOG_VARIANCE_RANGE
from diff4splat.training.losses.autoencoder import (
    CHARBONNIER_WIDTH,
    charbonnier,
    kl_divergence,
)

F64 = torch.float64


@settings(max_examples=25, deadline=None)
@given(mean=st.floats(-3, 3), std=st.floats(0.1, 3))
def test_divergence_against_quadrature(mean: float, std: float) -> None:
    means = torch.full((1, 2, 1, 1, 1), mean, dtype=F64)
    loss = kl_divergence(means, torch.full_like(means, 2 * math.log(std)))
    assert float(loss) == pytest.approx(oracle.normal_divergence(mean, std), rel=1e-6, abs=1e-8)


def test_the_standard_normal_costs_nothing() -> None:
    zeros = torch.zeros(2, 1, 1, 2, 2, requires_grad=True)
    loss = kl_divergence(zeros, zeros)
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert not zeros.grad.any()


def test_divergence_is_a_mean_per_element() -> None:
    mean, log_variance = torch.randn(2, 3, 2, 2, 2, 2, dtype=F64)
    loss = kl_divergence(mean, log_variance)
    each = 0.5 * (mean**2 + log_variance.exp() - 1 - log_variance)
    torch.testing.assert_close(loss, torch.stack([each[b].mean() for b in range(3)]))


def test_near_the_standard_normal_no_digits_are_lost() -> None:
    small = torch.full((1, 1, 1, 1, 1), 1e-2)
    loss = kl_divergence(torch.zeros_like(small), small)
    assert float(loss) == pytest.approx(0.5 * (math.expm1(1e-2) - 1e-2), rel=1e-4)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float32])
def test_the_whole_range_of_the_encoder_is_finite(dtype: torch.dtype) -> None:
    log_variance = torch.tensor(LOG_VARIANCE_RANGE, dtype=dtype).reshape(2, 1, 1, 1, 1)
    log_variance.requires_grad_()
    mean = torch.full_like(log_variance, 6e4).detach().requires_grad_()
    loss = kl_divergence(mean, log_variance)
    loss.sum().backward()
    assert loss.dtype == torch.float32
    assert loss.isfinite().all()
    assert mean.grad.isfinite().all()
    # A float16 gradient of 2.4e8 can only be infinite: the loss scaler's business.
    assert dtype == torch.float16 or log_variance.grad.isfinite().all()


def test_charbonnier_against_the_formula() -> None:
    video, reference = torch.randn(2, 2, 3, 4, 2, 2, dtype=F64)
    expected = [
        sum(
            math.sqrt((a - b) ** 2 + CHARBONNIER_WIDTH**2) - CHARBONNIER_WIDTH
            for a, b in zip(
                video[i].flatten().tolist(), reference[i].flatten().tolist(), strict=True
            )
        )
        / video[i].numel()
        for i in range(2)
    ]
    torch.testing.assert_close(charbonnier(video, reference), torch.tensor(expected, dtype=F64))


def test_equal_videos_cost_nothing() -> None:
    video = torch.rand(2, 3, 1, 2, 2, requires_grad=True)
    loss = charbonnier(video, video.detach())
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert not video.grad.any()


@pytest.mark.parametrize("size", [1e-30, 1e-3, 1e30])
def test_extreme_errors_stay_finite(size: float) -> None:
    video = torch.full((1, 3, 1, 1, 1), size, requires_grad=True)
    loss = charbonnier(video, torch.zeros(1, 3, 1, 1, 1))
    loss.sum().backward()
    assert loss.isfinite().all()
    assert 0 <= float(loss.detach()) <= size * (1 + 1e-6)
    assert video.grad.isfinite().all()


def test_gradients() -> None:
    mean, log_variance = (torch.randn(2, 1, 1, 2, 1, dtype=F64).requires_grad_() for _ in "ab")
    assert torch.autograd.gradcheck(kl_divergence, (mean, log_variance))
    assert torch.autograd.gradcheck(charbonnier, (mean, log_variance))


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    one, two = torch.zeros(1, 1, 1, 1, 1), torch.zeros(2, 1, 1, 1, 1)
    with pytest.raises(ShapeError, match=r"log_variance: expected \(1, 1.*, got \(2, 1"):
        kl_divergence(one, two)
    with pytest.raises(ShapeError, match=r"video: expected \(2, 1.*, got \(1, 1"):
        charbonnier(one, two)

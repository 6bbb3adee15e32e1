import numpy as np
import oracles_losses as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.training.losses.flow_matching import flow_matching

F64 = torch.float64


def latents(*shape: int, dtype: torch.dtype = F64) -> list[torch.Tensor]:
    return [torch.randn(*shape, dtype=dtype) for _ in range(3)]


@pytest.mark.parametrize("first_frame_is_clean", [False, True])
def test_against_the_formula(first_frame_is_clean: bool) -> None:
    tensors = latents(3, 2, 4, 3, 2)
    loss = flow_matching(*tensors, first_frame_is_clean=first_frame_is_clean)
    expected = oracle.flow_matching(*[t.numpy() for t in tensors], int(first_frame_is_clean))
    np.testing.assert_allclose(loss, expected, rtol=1e-12)


def test_the_true_velocity_costs_nothing() -> None:
    _, clean, noise = latents(2, 2, 2, 2, 2)
    assert flow_matching(noise - clean, clean, noise).tolist() == [0, 0]


@settings(max_examples=25, deadline=None)
@given(error=st.floats(-1e3, 1e3))
def test_a_constant_error_is_squared(error: float) -> None:
    _, clean, noise = latents(2, 1, 3, 2, 2)
    loss = flow_matching(noise - clean + error, clean, noise)
    torch.testing.assert_close(loss, torch.full((2,), error**2, dtype=F64), rtol=1e-9, atol=1e-12)


def test_the_clean_first_frame_does_not_count() -> None:
    velocity, clean, noise = latents(2, 2, 3, 2, 2)
    before = flow_matching(velocity, clean, noise, first_frame_is_clean=True)
    velocity[:, :, 0] = 1e6
    velocity.requires_grad_()
    after = flow_matching(velocity, clean, noise, first_frame_is_clean=True)
    after.sum().backward()
    assert torch.equal(before, after.detach())
    assert not velocity.grad[:, :, 0].any()
    assert velocity.grad[:, :, 1:].all()


def test_a_still_image_leaves_nothing_to_learn() -> None:
    velocity, clean, noise = latents(2, 2, 1, 2, 2)
    velocity.requires_grad_()
    loss = flow_matching(velocity, clean, noise, first_frame_is_clean=True)
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert not velocity.grad.any()


def test_weights_multiply_their_element() -> None:
    tensors = latents(2, 2, 2, 2, 2)
    weighted = flow_matching(*tensors, weights=torch.tensor([0.0, 3.0], dtype=F64))
    torch.testing.assert_close(weighted, flow_matching(*tensors) * torch.tensor([0.0, 3.0]))


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_widened(dtype: torch.dtype) -> None:
    largest = torch.finfo(torch.float16).max
    velocity = torch.full((1, 1, 2, 2, 2), largest, dtype=dtype, requires_grad=True)
    clean = torch.full_like(velocity, largest).detach()
    loss = flow_matching(velocity, clean, -clean)
    loss.sum().backward()
    assert loss.dtype == torch.float32
    assert float(loss.detach()) == pytest.approx(9 * float(clean[0, 0, 0, 0, 0]) ** 2, rel=1e-6)
    assert velocity.grad.isfinite().all()


def test_gradient() -> None:
    velocity, clean, noise = latents(2, 1, 2, 1, 2)
    velocity.requires_grad_()
    assert torch.autograd.gradcheck(
        lambda v: flow_matching(v, clean, noise, first_frame_is_clean=True), velocity
    )


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    one, two = torch.zeros(1, 2, 2, 2, 2), torch.zeros(2, 2, 2, 2, 2)
    with pytest.raises(ShapeError, match=r"velocity: expected \(2, 2, 2, 2, 2\), got \(1, 2"):
        flow_matching(one, two, two)
    with pytest.raises(ShapeError, match=r"noise: expected \(2, 2, 2, 2, 2\), got \(1, 2"):
        flow_matching(two, two, one)
    with pytest.raises(ShapeError, match=r"weights: expected \(2,\), got \(1,\)"):
        flow_matching(two, two, two, weights=torch.ones(1))

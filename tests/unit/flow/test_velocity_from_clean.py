"""The velocity that leads to a predicted clean latent."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import seeded_normal

from diff4splat.errors import ShapeError
from diff4splat.flow.path import add_noise, clean_from_velocity, velocity, velocity_from_clean

F64 = torch.float64


@settings(max_examples=25, deadline=None)
@given(level=st.floats(1e-3, 1))
def test_it_leads_to_the_clean_latent(level: float) -> None:
    noisy, clean = seeded_normal(2, 3, 4), seeded_normal(2, 3, 4, seed=1)
    rate = velocity_from_clean(noisy, clean, torch.full((2, 1, 1), level, dtype=F64))
    torch.testing.assert_close(clean_from_velocity(noisy, rate, level), clean)


def test_the_true_clean_latent_gives_the_true_velocity() -> None:
    clean, noise = seeded_normal(2, 3, 4), seeded_normal(2, 3, 4, seed=1)
    noisy = add_noise(clean, noise, 0.3)
    rate = velocity_from_clean(noisy, clean, torch.full((2, 1, 1), 0.3, dtype=F64))
    torch.testing.assert_close(rate, velocity(clean, noise))


def test_at_level_zero_nothing_moves_and_gradients_are_finite() -> None:
    noisy, clean = (seeded_normal(2, 3, seed=seed).requires_grad_() for seed in range(2))
    level = torch.tensor([[0.0], [0.5]], dtype=F64)
    rate = velocity_from_clean(noisy, clean, level)
    rate.square().sum().backward()
    assert not rate[0].any() and bool(rate[1].all())
    for tensor in (noisy, clean):
        assert not tensor.grad[0].any() and bool(tensor.grad[1].all())
        assert bool(tensor.grad.isfinite().all())


def test_every_latent_frame_has_its_own_level() -> None:
    noisy, clean = seeded_normal(2, 3, 4, 2, 2), seeded_normal(2, 3, 4, 2, 2, seed=1)
    level = torch.tensor([[0.0, 0.25, 0.5, 1.0], [1.0, 0.5, 0.0, 0.1]], dtype=F64)
    rate = velocity_from_clean(noisy, clean, level[:, None, :, None, None])
    for sample, frame in ((s, f) for s in range(2) for f in range(4)):
        here = (sample, slice(None), frame)
        at = float(level[sample, frame])
        wanted = (noisy[here] - clean[here]) / at if at else torch.zeros_like(noisy[here])
        torch.testing.assert_close(rate[here], wanted)


def test_gradient() -> None:
    tensors = [seeded_normal(2, 3, seed=seed).requires_grad_() for seed in range(2)]
    level = torch.tensor([[0.0], [0.7]], dtype=F64)
    assert torch.autograd.gradcheck(velocity_from_clean, (*tensors, level))


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_the_type_of_numbers_stays(dtype: torch.dtype) -> None:
    noisy = torch.ones(2, 3, dtype=dtype)
    level = torch.tensor([[0.0], [0.5]], dtype=dtype)
    assert velocity_from_clean(noisy, 0 * noisy, level).dtype == dtype


def test_empty_batch() -> None:
    empty = torch.zeros(0, 3)
    assert velocity_from_clean(empty, empty, torch.zeros(0, 1)).shape == (0, 3)


def test_refuses_to_broadcast_what_is_clean(as_shipped: None) -> None:
    noisy, clean = torch.zeros(2, 3), torch.zeros(1, 3)
    with pytest.raises(ShapeError, match=r"clean: expected \(2, 3\), got \(1, 3\)"):
        velocity_from_clean(noisy, clean, torch.ones(2, 1))

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_flow import seeded_normal

from diff4splat.errors import ShapeError
from diff4splat.flow.path import add_noise, clean_from_velocity, noise_from_velocity, velocity

levels = st.floats(0, 1)


@settings(max_examples=25, deadline=None)
@given(level=levels)
def test_velocity_recovers_both_ends(level: float) -> None:
    clean, noise = seeded_normal(2, 3, 4), seeded_normal(2, 3, 4, seed=1)
    noisy, rate = add_noise(clean, noise, level), velocity(clean, noise)
    torch.testing.assert_close(clean_from_velocity(noisy, rate, level), clean)
    torch.testing.assert_close(noise_from_velocity(noisy, rate, level), noise)


def test_level_zero_is_data_and_level_one_is_noise() -> None:
    clean, noise = seeded_normal(2, 3), seeded_normal(2, 3, seed=1)
    assert torch.equal(add_noise(clean, noise, 0.0), clean)
    assert torch.equal(add_noise(clean, noise, 1.0), noise)


def test_velocity_is_the_derivative_of_the_path() -> None:
    clean, noise = seeded_normal(2, 3), seeded_normal(2, 3, seed=1)
    level = torch.tensor([0.2, 0.9], dtype=torch.float64)
    tangent = torch.func.jvp(
        lambda s: add_noise(clean, noise, s), (level,), (torch.ones_like(level),)
    )[1]
    torch.testing.assert_close(tangent, velocity(clean, noise))


def test_each_batch_element_has_its_own_level() -> None:
    clean, noise = seeded_normal(2, 3, 4, 5), seeded_normal(2, 3, 4, 5, seed=1)
    level = torch.tensor([0.25, 1.0], dtype=torch.float64)
    noisy = add_noise(clean, noise, level)
    torch.testing.assert_close(noisy[0], 0.75 * clean[0] + 0.25 * noise[0])
    torch.testing.assert_close(noisy[1], noise[1])
    torch.testing.assert_close(clean_from_velocity(noisy, noise - clean, level), clean)
    torch.testing.assert_close(noise_from_velocity(noisy, noise - clean, level), noise)


def test_gradients() -> None:
    tensors = [seeded_normal(2, 3, seed=s).requires_grad_() for s in range(2)]
    level = torch.tensor([0.0, 0.7], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(add_noise, (*tensors, level))
    assert torch.autograd.gradcheck(clean_from_velocity, (*tensors, level))
    assert torch.autograd.gradcheck(noise_from_velocity, (*tensors, level))
    assert torch.autograd.gradcheck(velocity, tensors)


def test_empty_batch() -> None:
    empty = torch.zeros(0, 3)
    assert add_noise(empty, empty, torch.zeros(0)).shape == (0, 3)


def test_refuses_to_broadcast(as_shipped: None) -> None:
    clean, noise = torch.zeros(2, 3), torch.zeros(1, 3)
    with pytest.raises(ShapeError, match=r"noise: expected \(2, 3\), got \(1, 3\)"):
        add_noise(clean, noise, 0.5)
    with pytest.raises(ShapeError, match=r"noise: expected \(2, 3\)"):
        velocity(clean, noise)
    with pytest.raises(ShapeError, match=r"velocity: expected \(2, 3\)"):
        clean_from_velocity(clean, noise, 0.5)
    with pytest.raises(ShapeError, match=r"velocity: expected \(2, 3\)"):
        noise_from_velocity(clean, noise, 0.5)
    with pytest.raises(ShapeError, match=r"level: expected \(2,\), one per .*, got \(3,\)"):
        add_noise(clean, clean, torch.zeros(3))

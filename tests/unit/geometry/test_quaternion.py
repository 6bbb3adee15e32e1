"""Rotation algebra against its own laws, SciPy-free, in float64."""

import math

import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch.autograd import gradcheck

from diff4splat.geometry import quaternion

F64 = torch.float64
numbers = st.floats(-1, 1, allow_nan=False, width=32)
quats = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: sum(v * v for v in q) > 1e-4)


def as_tensor(values: tuple[float, ...]) -> torch.Tensor:
    return torch.tensor(values, dtype=F64)


@given(quats, quats)
@settings(max_examples=25, deadline=None)
def test_product_of_quaternions_is_the_product_of_matrices(left: tuple, right: tuple) -> None:
    a, b = quaternion.normalize(as_tensor(left)), quaternion.normalize(as_tensor(right))
    torch.testing.assert_close(
        quaternion.to_matrix(quaternion.multiply(a, b)),
        quaternion.to_matrix(a) @ quaternion.to_matrix(b),
    )


@given(quats)
@settings(max_examples=25, deadline=None)
def test_matrix_and_back_is_the_same_rotation(values: tuple) -> None:
    matrix = quaternion.to_matrix(as_tensor(values))
    torch.testing.assert_close(torch.linalg.det(matrix), torch.ones((), dtype=F64))
    torch.testing.assert_close(quaternion.to_matrix(quaternion.from_matrix(matrix)), matrix)


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
def test_half_turns_survive_the_round_trip(axis: list[float]) -> None:
    half_turn = quaternion.from_axis_angle(
        torch.tensor(axis, dtype=F64), torch.tensor(torch.pi, dtype=F64)
    )
    matrix = quaternion.to_matrix(half_turn)
    torch.testing.assert_close(quaternion.to_matrix(quaternion.from_matrix(matrix)), matrix)


@given(quats, quats, st.floats(0, 1, width=32))
@example((0.0, 0.0, 0.0, -1.0), (0.0, 0.0, 1.0, 1e-5), 0.5)
@settings(max_examples=25, deadline=None)
def test_slerp_turns_at_constant_speed(start: tuple, stop: tuple, weight: float) -> None:
    a, b = quaternion.normalize(as_tensor(start)), quaternion.normalize(as_tensor(stop))
    part = quaternion.slerp(a, b, torch.tensor(weight, dtype=F64))
    cosine = (a * b).sum().clamp(-1, 1)
    # Half a turn goes as it is given, also where the other way is shorter by a rounding error.
    whole = 2 * torch.acos(cosine if cosine > -quaternion.HALF_TURN else -cosine)
    angle = 2 * torch.acos((a * part).sum().clamp(-1, 1))
    torch.testing.assert_close(angle, weight * whole, atol=2e-6, rtol=0)


def test_gradients_agree_with_finite_differences() -> None:
    a = torch.randn(4, 4, dtype=F64, requires_grad=True)
    b = torch.randn(4, 4, dtype=F64, requires_grad=True)
    weight = torch.rand(4, dtype=F64, requires_grad=True)
    assert gradcheck(quaternion.to_matrix, a)
    assert gradcheck(quaternion.multiply, (a, b))
    assert gradcheck(lambda q: quaternion.from_matrix(quaternion.to_matrix(q)), a)
    assert gradcheck(quaternion.slerp, (a, b, weight))
    assert gradcheck(quaternion.slerp, (a, a.detach() * 1.0, weight))


@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-12, 1.0, 1e18, 1e30])
@pytest.mark.parametrize("dtype", [torch.float32, F64])
def test_any_length_gives_a_rotation_and_a_finite_gradient(size: float, dtype: torch.dtype) -> None:
    quats = (torch.tensor([[0.5, -0.5, 0.5, 0.5]], dtype=dtype) * size).requires_grad_()
    matrix = quaternion.to_matrix(quats)
    torch.testing.assert_close(matrix @ matrix.mT, torch.eye(3, dtype=dtype)[None])
    matrix.sum().backward()
    assert torch.isfinite(quats.grad).all()


def test_opposite_quaternions_are_the_same_rotation_to_slerp() -> None:
    a = quaternion.normalize(torch.randn(4, dtype=F64))
    torch.testing.assert_close(quaternion.slerp(a, -a, torch.tensor(0.3, dtype=F64)), a)


def test_empty_batches_pass_through() -> None:
    empty = torch.zeros(0, 4)
    assert quaternion.to_matrix(empty).shape == (0, 3, 3)
    assert quaternion.from_matrix(torch.zeros(0, 3, 3)).shape == (0, 4)


def test_nan_is_not_mistaken_for_no_rotation() -> None:
    quats = torch.tensor([[float("nan"), 0, 0, 0], [1.0, 0, 0, 0]])
    assert torch.isnan(quaternion.normalize(quats)[0]).any()
    assert torch.isfinite(quaternion.normalize(quats)[1]).all()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("noise", [0.0, 3e-5])
def test_half_a_turn_takes_one_way_round_whatever_is_rounded(
    dtype: torch.dtype, noise: float
) -> None:
    generator = torch.Generator().manual_seed(0)
    start = quaternion.normalize(torch.randn(200, 4, generator=generator, dtype=F64))
    half_turn = quaternion.from_axis_angle(
        torch.randn(200, 3, generator=generator, dtype=F64), torch.full((200,), math.pi, dtype=F64)
    )
    stop = quaternion.multiply(start, half_turn)
    want = quaternion.normalize(start + stop)
    stop = stop + noise * torch.randn(200, 4, generator=generator, dtype=F64) / 2
    got = quaternion.slerp(start.to(dtype), stop.to(dtype), torch.full((200,), 0.5, dtype=dtype))
    torch.testing.assert_close(got.double(), want, atol=1e-4, rtol=0)

"""Pairs of unit quaternions are the rotations of space-time."""

import math

import oracles_spacetime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.geometry import quaternion
from diff4splat.geometry.rotation_4d import quaternion_pair, rotation_4d

F64 = torch.float64
EYE = torch.eye(4, dtype=F64)


def pairs(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    return (
        oracles_spacetime.normal(count, 4, seed=seed),
        oracles_spacetime.normal(count, 4, seed=seed + 1),
    )


def test_the_matrix_is_that_of_the_two_factors() -> None:
    left, right = pairs(20)
    turned = rotation_4d(left, right)
    for row in range(20):
        want = oracles_spacetime.rotation(left[row].numpy(), right[row].numpy())
        torch.testing.assert_close(turned[row], torch.from_numpy(want.copy()))


def test_the_matrices_are_proper_rotations() -> None:
    turned = rotation_4d(*pairs(50))
    torch.testing.assert_close(turned @ turned.mT, EYE.expand(50, 4, 4))
    torch.testing.assert_close(torch.det(turned), torch.ones(50, dtype=F64))


def test_equal_quaternions_turn_space_alone() -> None:
    left, _ = pairs(20)
    turned = rotation_4d(left, left)
    torch.testing.assert_close(turned[:, 3], EYE[3].expand(20, 4))
    torch.testing.assert_close(turned[:, :, 3], EYE[3].expand(20, 4))
    w, x, y, z = left.unbind(-1)
    ordinary = quaternion.to_matrix(torch.stack([w, -z, -y, -x], -1))
    torch.testing.assert_close(turned[:, :3, :3], ordinary)


@pytest.mark.parametrize("angle_rad", [-2.5, 0.0, 0.3, math.pi])
def test_opposite_angles_turn_x_into_time(angle_rad: float) -> None:
    half = torch.tensor(angle_rad / 2, dtype=F64)
    nil = torch.zeros_like(half)
    left = torch.stack([half.cos(), nil, nil, half.sin()])
    turned = rotation_4d(left, quaternion.conjugate(left))
    torch.testing.assert_close(turned[1:3], EYE[1:3])
    flat = turned[[0, 3]][:, [0, 3]]
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    # The sense is that of the closed form: covariance (b² − a²) sin cos for scales a (x), b (t).
    torch.testing.assert_close(flat, torch.tensor([[c, s], [-s, c]], dtype=F64))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999))
def test_a_rotation_has_its_pair_up_to_one_sign(seed: int) -> None:
    left, right = pairs(4, seed)
    again = quaternion_pair(rotation_4d(left, right))
    unit = quaternion.normalize(left), quaternion.normalize(right)
    sign = (again[0] * unit[0]).sum(-1, keepdim=True).sign()
    torch.testing.assert_close(again[0] * sign, unit[0])
    torch.testing.assert_close(again[1] * sign, unit[1])


def test_half_turns_and_permutations_have_pairs() -> None:
    """Rotations whose pairs have zeros everywhere, where a sign is easily lost."""
    signs = torch.tensor([[1.0, 1, -1, -1], [-1, -1, -1, -1], [1, -1, 1, -1]], dtype=F64)
    cycles = [EYE[[1, 2, 0, 3]], EYE[[1, 0, 3, 2]], EYE[[3, 2, 1, 0]]]
    for rotation in [*map(torch.diag, signs), *cycles, EYE]:
        torch.testing.assert_close(rotation_4d(*quaternion_pair(rotation)), rotation)


def test_zero_quaternions_turn_nothing_and_keep_gradients_finite() -> None:
    left = torch.zeros(1, 4, dtype=F64, requires_grad=True)
    turned = rotation_4d(left, torch.zeros(1, 4, dtype=F64))
    torch.testing.assert_close(turned[0], EYE)
    turned.sum().backward()
    assert bool(torch.isfinite(left.grad).all())
    assert rotation_4d(torch.zeros(0, 4), torch.zeros(0, 4)).shape == (0, 4, 4)
    assert quaternion_pair(torch.zeros(0, 4, 4))[0].shape == (0, 4)


def test_the_rotation_is_differentiable() -> None:
    left, right = pairs(2)
    assert torch.autograd.gradcheck(rotation_4d, (left.requires_grad_(), right.requires_grad_()))

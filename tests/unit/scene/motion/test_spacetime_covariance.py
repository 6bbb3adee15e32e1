"""Slices of native 4D Gaussians against closed forms and the 4 × 4 covariance."""

import math
from dataclasses import replace

import numpy as np
import oracles_spacetime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene.motion.spacetime_covariance import SpacetimeCovariance, conditional

F64 = torch.float64


def shapes(count: int, seed: int = 0) -> SpacetimeCovariance:
    return oracles_spacetime.primitives(count, seed).covariance


def covariances(factors: torch.Tensor) -> torch.Tensor:
    return factors @ factors.mT


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), time_s=st.floats(-2.0, 2.0))
def test_the_slice_is_that_of_the_covariance(seed: int, time_s: float) -> None:
    given_shapes = shapes(3, seed)
    slices = conditional(given_shapes)
    for row in range(3):
        sigma = oracles_spacetime.covariance(given_shapes, row)
        want = oracles_spacetime.slice_at(given_shapes.means[row].numpy(), sigma, time_s)
        elapsed = time_s - slices.time_centers_s[row]
        mean = slices.means[row] + slices.velocities[row] * elapsed
        torch.testing.assert_close(mean, torch.from_numpy(want.mean))
        got = covariances(slices.factors)[row]
        torch.testing.assert_close(got, torch.from_numpy(want.covariance))
        pulse = torch.exp(-0.5 * (elapsed / slices.time_deviations_s[row]) ** 2)
        assert float(pulse) == pytest.approx(want.pulse, rel=1e-9)


def test_the_matrices_are_those_of_the_two_quaternions() -> None:
    given_shapes = shapes(5)
    for row, matrix in enumerate(given_shapes.matrices()):
        want = oracles_spacetime.covariance(given_shapes, row)
        torch.testing.assert_close(matrix, torch.from_numpy(want.copy()))


@pytest.mark.parametrize("angle_rad", [-1.2, 0.0, 0.4, math.pi / 2])
def test_a_turn_of_x_into_time_has_a_closed_form(angle_rad: float) -> None:
    x_scale, t_scale = 0.5, 3.0
    half = torch.tensor(angle_rad / 2, dtype=F64)
    nil = torch.zeros_like(half)
    left = torch.stack([half.cos(), nil, nil, half.sin()])[None]
    slices = conditional(
        SpacetimeCovariance(
            means=torch.zeros(1, 4, dtype=F64),
            scales=torch.tensor([[x_scale, 0.2, 0.3, t_scale]], dtype=F64),
            left_quats=left,
            right_quats=quaternion.conjugate(left),
        )
    )
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    variance = (x_scale * s) ** 2 + (t_scale * c) ** 2
    speed = (t_scale**2 - x_scale**2) * s * c / variance
    assert float(slices.time_deviations_s) ** 2 == pytest.approx(variance)
    torch.testing.assert_close(slices.velocities, torch.tensor([[speed, 0, 0]], dtype=F64))
    axes = torch.tensor([(x_scale * t_scale) ** 2 / variance, 0.04, 0.09], dtype=F64)
    torch.testing.assert_close(covariances(slices.factors)[0], torch.diag(axes))


def test_equal_quaternions_mean_no_motion_and_an_ordinary_rotation() -> None:
    given_shapes = shapes(6)
    given_shapes = replace(given_shapes, right_quats=given_shapes.left_quats)
    slices = conditional(given_shapes)
    torch.testing.assert_close(slices.velocities, torch.zeros(6, 3, dtype=F64))
    torch.testing.assert_close(slices.time_deviations_s, given_shapes.scales[:, 3])
    w, x, y, z = given_shapes.left_quats.unbind(-1)
    turn = quaternion.to_matrix(torch.stack([w, -z, -y, -x], -1))
    want = covariances(turn * given_shapes.scales[:, None, :3])
    torch.testing.assert_close(covariances(slices.factors), want)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), time_s=st.floats(-1.0, 1.0))
def test_a_ray_through_space_time_meets_the_slice(seed: int, time_s: float) -> None:
    """The largest value on the ray in 4D is the pulse times the largest value in the slice."""
    given_shapes = shapes(2, seed)
    slices = conditional(given_shapes)
    start, direction = oracles_spacetime.normal(2, 3, seed=seed + 50).numpy()
    for row in range(2):
        turn = oracles_spacetime.rotation(
            given_shapes.left_quats[row].numpy(), given_shapes.right_quats[row].numpy()
        )
        inverse = turn @ np.diag(given_shapes.scales[row].numpy() ** -2.0) @ turn.T
        mean = given_shapes.means[row].numpy()
        want = oracles_spacetime.largest_on_ray(mean, inverse, (start, direction), time_s)
        elapsed = time_s - float(slices.time_centers_s[row])
        center = slices.means[row] + slices.velocities[row] * elapsed
        covariance = covariances(slices.factors)[row]
        whitened = torch.linalg.solve_triangular(
            torch.linalg.cholesky(covariance),
            torch.stack([torch.from_numpy(start) - center, torch.from_numpy(direction)], -1),
            upper=False,
        )
        origin, along = whitened.unbind(-1)
        nearest = origin - along * (origin @ along) / (along @ along)
        pulse = math.exp(-0.5 * (elapsed / float(slices.time_deviations_s[row])) ** 2)
        got = pulse * math.exp(-0.5 * float(nearest @ nearest))
        assert got == pytest.approx(want, rel=0, abs=1e-12)


def test_float32_slices_stay_covariances_where_the_schur_complement_does_not() -> None:
    """Time scales of seconds beside scales in space that are 10⁴ times as small."""
    count = 2000
    exact = shapes(count)
    scales = 0.1 + 0.9 * oracles_spacetime.normal(count, 4, seed=9).sigmoid()
    exact = replace(exact, scales=scales * torch.tensor([1, 1, 1, 1e4], dtype=F64)).to(
        torch.float32
    )
    factors = conditional(exact).factors
    assert factors.dtype == torch.float32
    # Given time, the precision matrix is the block of the inverse: nothing is subtracted.
    double = exact.to(F64)
    turn = np.stack(
        [
            oracles_spacetime.rotation(left.numpy(), right.numpy())
            for left, right in zip(double.left_quats, double.right_quats, strict=True)
        ]
    )
    roots = torch.from_numpy(turn[:, :3].copy()) / double.scales[:, None]
    thinnest = torch.linalg.svdvals(roots)[:, 0].reciprocal()
    got = torch.linalg.svdvals(factors.double())[:, -1]
    assert float((got / thinnest - 1).abs().max()) < 1e-4
    assert bool((torch.linalg.eigvalsh(covariances(factors).double())[:, 0] > 0).all())
    sigma = exact.matrices()
    across = sigma[:, :3, 3:]
    schur = sigma[:, :3, :3] - across @ across.mT / sigma[:, 3:, 3:]
    broken = torch.linalg.eigvalsh(schur.double())[:, 0] <= 0
    assert float(broken.float().mean()) > 0.1


def test_slices_are_differentiable() -> None:
    given_shapes = shapes(2)

    def sliced(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        names = ("scales", "left_quats", "right_quats")
        slices = conditional(replace(given_shapes, **dict(zip(names, values, strict=True))))
        return covariances(slices.factors), slices.velocities, slices.time_deviations_s

    parts = (given_shapes.scales, given_shapes.left_quats, given_shapes.right_quats)
    assert torch.autograd.gradcheck(sliced, [part.clone().requires_grad_() for part in parts])


def test_round_gaussians_and_zero_quaternions_have_finite_gradients() -> None:
    leaves = {
        "scales": torch.ones(2, 4, dtype=F64),
        "left_quats": torch.zeros(2, 4, dtype=F64),
        "right_quats": torch.zeros(2, 4, dtype=F64),
    }
    for leaf in leaves.values():
        leaf.requires_grad_()
    slices = conditional(SpacetimeCovariance(means=torch.zeros(2, 4, dtype=F64), **leaves))
    torch.testing.assert_close(covariances(slices.factors), torch.eye(3, dtype=F64).expand(2, 3, 3))
    (slices.factors.sum() + slices.velocities.sum() + slices.time_deviations_s.sum()).backward()
    assert all(bool(torch.isfinite(leaf.grad).all()) for leaf in leaves.values())
    assert conditional(shapes(0)).factors.shape == (0, 3, 4)


@pytest.mark.usefixtures("as_shipped")
def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ShapeError, match=r"SpacetimeCovariance.scales: expected \(2, 4\)"):
        replace(shapes(2), scales=torch.ones(2, 3))

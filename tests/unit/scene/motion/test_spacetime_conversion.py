"""Native 4D Gaussians and scenes that move, fade and change colour are one family."""

import math
from dataclasses import replace

import oracles_spacetime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_spacetime import motion, primitives, still_gaussians

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.spacetime_conversion import (
    SpacetimeGaussians,
    from_spacetime,
    join_orders,
    split_orders,
    to_spacetime,
)

F64 = torch.float64
TIMING = {"time_range_s": (-2.0, 2.0), "period_s": 3.0}


def covariances(gaussians: Gaussians) -> torch.Tensor:
    axes = quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None]
    return axes @ axes.mT


def assert_same_state(left: Gaussians, right: Gaussians) -> None:
    for name in ("means", "opacities", "sh"):
        torch.testing.assert_close(getattr(left, name), getattr(right, name))
    torch.testing.assert_close(covariances(left), covariances(right))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), time_s=st.floats(-2.0, 2.0))
def test_states_are_those_of_the_covariance_in_space_time(seed: int, time_s: float) -> None:
    given_ones = primitives(3, seed)
    gaussians, moving = to_spacetime(given_ones, **TIMING)
    state = moving.state_at(gaussians, time_s)
    for row in range(3):
        shape = given_ones.covariance
        sigma = oracles_spacetime.covariance(shape, row)
        want = oracles_spacetime.slice_at(shape.means[row].numpy(), sigma, time_s)
        torch.testing.assert_close(state.means[row], torch.from_numpy(want.mean))
        torch.testing.assert_close(covariances(state)[row], torch.from_numpy(want.covariance))
        there = want.pulse if want.pulse > 0.05 else 0.0
        torch.testing.assert_close(state.opacities[row], given_ones.opacities[row] * there)
        elapsed = time_s - float(shape.means[row, 3])
        sh = oracles_spacetime.harmonics_at(given_ones.orders[row].numpy(), elapsed, 3.0)
        torch.testing.assert_close(state.sh[row], torch.from_numpy(sh))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), orders=st.integers(1, 3))
def test_there_and_back_keeps_the_covariance(seed: int, orders: int) -> None:
    given_ones = primitives(4, seed, orders)
    again = from_spacetime(*to_spacetime(given_ones, **TIMING))
    torch.testing.assert_close(again.covariance.matrices(), given_ones.covariance.matrices())
    torch.testing.assert_close(again.covariance.means, given_ones.covariance.means)
    assert torch.equal(again.orders, given_ones.orders)
    assert torch.equal(again.opacities, given_ones.opacities)
    for quats in (again.covariance.left_quats, again.covariance.right_quats):
        torch.testing.assert_close(quats.norm(dim=-1), torch.ones(4, dtype=F64))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 9999), time_s=st.floats(0.0, 2.0), waves=st.integers(0, 2))
def test_back_and_there_keeps_the_state(seed: int, time_s: float, waves: int) -> None:
    gaussians, moving = still_gaussians(4, seed=seed), motion([0, 1, 2, 3], seed, waves)
    timing = {"time_range_s": moving.time_range_s, "period_s": moving.period_s}
    again, moved = to_spacetime(from_spacetime(gaussians, moving), **timing)
    assert_same_state(moved.state_at(again, time_s), moving.state_at(gaussians, time_s))


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_round_gaussians_that_stand_have_equal_quaternions(scale: float) -> None:
    """All axes are alike, or have no length: the worst case for finding them."""
    gaussians = replace(still_gaussians(3), scales=torch.full((3, 3), scale, dtype=F64))
    moving = replace(
        motion([0, 1, 2]),
        velocities=torch.zeros(3, 3, dtype=F64),
        time_deviations_s=torch.ones(3, dtype=F64),
    )
    shape = from_spacetime(gaussians, moving).covariance
    sides = torch.tensor([scale, scale, scale, 1.0], dtype=F64)
    torch.testing.assert_close(shape.matrices(), torch.diag(sides**2).expand(3, 4, 4))
    torch.testing.assert_close(shape.left_quats, shape.right_quats)


def test_what_stands_has_its_time_scale_last() -> None:
    moving = replace(motion([0, 1, 2]), velocities=torch.zeros(3, 3, dtype=F64))
    shape = from_spacetime(still_gaussians(3), moving).covariance
    torch.testing.assert_close(shape.scales[:, 3], moving.time_deviations_s)
    sign = (shape.left_quats * shape.right_quats).sum(-1, keepdim=True).sign()
    torch.testing.assert_close(shape.left_quats, sign * shape.right_quats)


def test_float32_comes_back_as_float32_and_close() -> None:
    gaussians, moving = still_gaussians(50).to(torch.float32), motion(list(range(50)))
    moving = moving.to(torch.float32)
    fourfold = from_spacetime(gaussians, moving)
    assert fourfold.covariance.scales.dtype == torch.float32
    timing = {"time_range_s": moving.time_range_s, "period_s": moving.period_s}
    again, moved = to_spacetime(fourfold, **timing)
    assert again.quats.dtype == moved.velocities.dtype == torch.float32
    torch.testing.assert_close(covariances(again), covariances(gaussians), rtol=1e-3, atol=1e-4)
    torch.testing.assert_close(moved.velocities, moving.velocities, rtol=1e-3, atol=1e-4)


def test_rotations_that_come_out_are_proper() -> None:
    gaussians, _ = to_spacetime(primitives(50), **TIMING)
    torch.testing.assert_close(gaussians.quats.norm(dim=-1), torch.ones(50, dtype=F64))


def test_order_zero_alone_is_ordinary_harmonics() -> None:
    gaussians, moving = to_spacetime(primitives(2, orders=1), **TIMING)
    assert moving.color_waves is None
    for time_s in (-1.0, 0.3):
        assert moving.state_at(gaussians, time_s).sh is gaussians.sh


def test_flat_coefficients_have_the_index_16_n_plus_harmonic() -> None:
    flat = torch.arange(2 * 48 * 3, dtype=F64).reshape(2, 48, 3)
    orders = split_orders(flat, harmonics.BAND_SIZES[-1])
    for order in range(3):
        for harmonic in range(16):
            assert torch.equal(orders[:, order, harmonic], flat[:, 16 * order + harmonic])
    assert torch.equal(join_orders(orders), flat)
    assert split_orders(flat[:, :4], 4).shape == (2, 1, 4, 3)
    with pytest.raises(ShapeError, match="expected 16, 32 or 48, got 47"):
        split_orders(flat[:, :47], 16)


@pytest.mark.parametrize("lasting", [math.inf, None])
def test_what_lasts_for_ever_has_no_place_in_space_time(lasting: float | None) -> None:
    moving = motion([0, 1] if lasting else [0])
    if lasting:
        endless = torch.tensor([1.0, lasting], dtype=F64)
        moving = replace(moving, time_deviations_s=endless)
    with pytest.raises(InputError, match="finite length for each of 2, got 1 without"):
        from_spacetime(still_gaussians(2), moving)


def test_nobody_at_all() -> None:
    gaussians, moving = to_spacetime(primitives(0), **TIMING)
    assert len(gaussians) == len(moving.moving_index) == 0
    assert isinstance(moving, SpacetimeMotion)
    assert len(from_spacetime(gaussians, moving).opacities) == 0


@pytest.mark.usefixtures("as_shipped")
def test_wrong_shapes_are_named() -> None:
    good = primitives(2)
    with pytest.raises(ShapeError, match=r"SpacetimeGaussians.opacities: expected 2, got 3"):
        replace(good, opacities=torch.ones(3))
    with pytest.raises(ShapeError, match=r"SpacetimeGaussians.orders: expected"):
        SpacetimeGaussians(
            covariance=good.covariance, opacities=good.opacities, orders=torch.ones(2, 4, 4, 3)
        )


def test_covariances_whose_slices_overflow_are_refused() -> None:
    wild = primitives(2, 0)
    shape = replace(wild.covariance, scales=torch.full_like(wild.covariance.scales, torch.inf))
    with pytest.raises(InputError, match="expected finite slices"):
        to_spacetime(replace(wild, covariance=shape), **TIMING)

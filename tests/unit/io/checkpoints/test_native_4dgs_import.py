"""Raw arrays of native 4D Gaussians become activated ones."""

from dataclasses import replace

import oracles_spacetime
import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.io.checkpoints.native_4dgs_import import RawSpacetime, from_raw_4d
from diff4splat.scene.motion.spacetime_conversion import to_spacetime


def raw(count: int = 3, colors: int = 48) -> RawSpacetime:
    ones = oracles_spacetime.primitives(count, orders=3, bands=16)
    shape, flat = ones.covariance, ones.orders.flatten(1, 2)[:, :colors]
    return RawSpacetime(
        positions=shape.means[:, :3],
        times_s=shape.means[:, 3:],
        log_scales=shape.scales[:, :3].log(),
        log_time_scales=shape.scales[:, 3:].log(),
        left_quats=shape.left_quats,
        right_quats=shape.right_quats,
        opacity_logits=ones.opacities.logit()[:, None],
        constant_colors=flat[:, :1],
        other_colors=flat[:, 1:],
    )


def test_logarithms_and_logits_are_undone() -> None:
    want, got = oracles_spacetime.primitives(3, orders=3, bands=16), from_raw_4d(raw())
    torch.testing.assert_close(got.covariance.means, want.covariance.means)
    torch.testing.assert_close(got.covariance.scales, want.covariance.scales)
    torch.testing.assert_close(got.covariance.matrices(), want.covariance.matrices())
    torch.testing.assert_close(got.opacities, want.opacities)
    assert torch.equal(got.orders, want.orders)


@pytest.mark.parametrize(
    ("colors", "shape"),
    [(1, (1, 1)), (4, (1, 4)), (9, (1, 9)), (16, (1, 16)), (32, (2, 16)), (48, (3, 16))],
)
def test_every_number_of_coefficients_that_they_store(colors: int, shape: tuple) -> None:
    assert tuple(from_raw_4d(raw(colors=colors)).orders.shape[1:3]) == shape


@pytest.mark.parametrize("colors", [2, 15, 20, 47])
def test_other_numbers_of_coefficients_are_refused(colors: int) -> None:
    with pytest.raises(ShapeError, match=f"coefficients: expected 16, 32 or 48, got {colors}"):
        from_raw_4d(raw(colors=colors))


def test_numbers_that_are_not_finite_are_named() -> None:
    broken = raw().log_scales.clone()
    broken[1, 1] = torch.nan
    with pytest.raises(InputError, match="raw log_scales: expected finite numbers, got 1 of 9"):
        from_raw_4d(replace(raw(), log_scales=broken))


def test_they_move_as_their_covariance_says() -> None:
    gaussians, motion = to_spacetime(from_raw_4d(raw()), time_range_s=(-2.0, 2.0), period_s=4.0)
    state = motion.state_at(gaussians, 0.25)
    shape = oracles_spacetime.primitives(3, orders=3, bands=16).covariance
    for row in range(3):
        sigma = oracles_spacetime.covariance(shape, row)
        want = oracles_spacetime.slice_at(shape.means[row].numpy(), sigma, 0.25)
        torch.testing.assert_close(state.means[row], torch.from_numpy(want.mean))


def test_nobody_at_all() -> None:
    assert len(from_raw_4d(raw(0)).opacities) == 0

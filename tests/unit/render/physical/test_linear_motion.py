"""Any motion as Gaussians that go straight: exact where it is, halfway where it is not."""

import math
from dataclasses import replace

import oracles_spacetime
import pytest
import torch
from oracles_physical import F64, dots, drifting, scene_of
from oracles_trace import brute_force, bundle, scene

from diff4splat.geometry import quaternion
from diff4splat.render.physical.linear_motion import (
    LinearSegment,
    is_linear,
    linear_segment,
    midpoint,
    native_segment,
    smoothed_segment,
    static_segment,
)
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene


def native(waves: int = 0) -> Scene:
    """Some stand, some move; all in front of the rays."""
    cloud = scene(12, seed=2, bands=4)
    motion = oracles_spacetime.motion([1, 2, 5, 7, 8, 11], waves=waves)
    return scene_of(cloud, motion)


def test_native_gaussians_are_exact_at_any_time() -> None:
    own = native()
    assert is_linear(own)
    assert not is_linear(native(waves=1))
    base_s = 0.7
    made = native_segment(own, -0.5, 0.5, base_s)
    settings = TraceSettings()
    for offset in (-0.4, 0.0, 0.3):
        rays = bundle(12)
        timed = replace(rays, time_s=torch.full((12,), offset, dtype=F64))
        moving = brute_force(made.gaussians, timed, settings, made.moving)
        frozen = brute_force(own.state_at(base_s + offset), rays, settings)
        torch.testing.assert_close(
            torch.from_numpy(moving.rgb), torch.from_numpy(frozen.rgb), rtol=0, atol=1e-12
        )
        assert frozen.alpha.max() > 0.3


def test_colours_that_wave_are_those_halfway() -> None:
    own = native(waves=2)
    made = native_segment(own, 0.1, 0.3, 1.0)
    want = 0.5 * (own.state_at(1.1).sh + own.state_at(1.3).sh)
    torch.testing.assert_close(made.gaussians.sh, want)


def test_times_of_centres_are_relative_in_full_precision() -> None:
    late = 1e6
    own = drifting(dots([(0, 0, 4)], dtype=F64), (1, 0, 0), (late, late + 1), late + 0.25)
    made = native_segment(own, 0.0, 1.0, late)
    assert float(made.moving.time_centers_s[0]) == 0.25


def test_between_two_states_means_go_from_one_to_the_other() -> None:
    early, late = scene(8, seed=0), scene(8, seed=1)
    made = linear_segment(early, late, -0.2, 0.6)
    for share in (0.0, 0.25, 1.0):
        since = -0.2 + 0.8 * share - made.moving.time_centers_s[:, None]
        want = (1 - share) * early.means + share * late.means
        torch.testing.assert_close(made.gaussians.means + made.moving.velocities * since, want)
    assert bool(made.moving.time_deviations_s.isinf().all())
    assert linear_segment(early, late, 0.3, 0.3).moving is None


def test_halfway_is_half_of_a_turn_and_of_a_stretch() -> None:
    early, late = scene(8, seed=0), scene(8, seed=1)
    made = midpoint(early, late)
    torch.testing.assert_close(made.scales, (early.scales * late.scales).sqrt())
    want = quaternion.slerp(early.quats, late.quats, torch.full((8,), 0.5, dtype=F64))
    torch.testing.assert_close(
        quaternion.to_matrix(made.quats), quaternion.to_matrix(want), rtol=0, atol=1e-9
    )
    flipped = midpoint(early, replace(late, quats=-late.quats))
    torch.testing.assert_close(
        quaternion.to_matrix(flipped.quats), quaternion.to_matrix(made.quats), rtol=0, atol=1e-12
    )


def test_halfway_between_equal_states_is_that_state_to_the_bit() -> None:
    own = scene(20, dtype=torch.float32)
    made = midpoint(own, own)
    for name in ("means", "scales", "opacities", "sh"):
        assert torch.equal(getattr(made, name), getattr(own, name)), name


@pytest.mark.parametrize("equal", [False, True])
def test_both_states_get_half_of_the_gradient_of_the_scales(equal: bool) -> None:
    early = torch.full((1, 3), 0.2, dtype=F64, requires_grad=True)
    late = torch.full((1, 3), 0.2 if equal else 0.8, dtype=F64, requires_grad=True)
    base = dots([(0, 0, 1)], dtype=F64)
    midpoint(replace(base, scales=early), replace(base, scales=late)).scales.sum().backward()
    # d √(a b) = √(b / a) / 2 da + √(a / b) / 2 db
    ratio = 1.0 if equal else 2.0
    torch.testing.assert_close(early.grad, torch.full((1, 3), 0.5 * ratio, dtype=F64))
    torch.testing.assert_close(late.grad, torch.full((1, 3), 0.5 / ratio, dtype=F64))


def test_scales_of_zero_and_no_turn_stay_finite() -> None:
    base = dots([(0, 0, 1)])
    flat = replace(base, scales=torch.zeros(1, 3), quats=torch.zeros(1, 4))
    leaf = torch.zeros(1, 3, requires_grad=True)
    made = midpoint(replace(flat, scales=leaf), base)
    assert bool(torch.isfinite(made.scales).all() and torch.isfinite(made.quats).all())
    made.scales.sum().backward()
    assert bool(torch.isfinite(leaf.grad).all())


def stretch_of(gaussians: Gaussians) -> LinearSegment:
    return static_segment(gaussians, 0.0, 0.0)


def test_smoothing_adds_the_variance_of_a_pixel_at_the_distance() -> None:
    own = dots([(0, 3, 4), (0, 0, 10)], 0.02, dtype=F64)
    place = torch.zeros(3, dtype=F64)
    made = smoothed_segment(stretch_of(own), place, 1e-4).gaussians.scales
    want = torch.tensor([math.sqrt(4e-4 + 25e-4), math.sqrt(4e-4 + 100e-4)], dtype=F64)
    torch.testing.assert_close(made, want[:, None].expand(2, 3))
    assert smoothed_segment(stretch_of(own), place, 0.0).gaussians is own


def test_smoothing_looks_where_a_gaussian_is_and_not_where_it_shines_most() -> None:
    # A hundred seconds before its centre it is five units away.
    own = drifting(dots([(0, 0, 305)], 0.02, dtype=F64), (0, 0, 3), (0.0, 100.0), 100.0)
    made = smoothed_segment(native_segment(own, -0.1, 0.1, 0.0), torch.zeros(3, dtype=F64), 1e-4)
    want = torch.full((1, 3), math.sqrt(4e-4 + 25e-4), dtype=F64)
    torch.testing.assert_close(made.gaussians.scales, want)


def test_smoothing_of_a_point_at_the_camera_is_finite() -> None:
    leaf = torch.zeros(1, 3, requires_grad=True)
    own = replace(dots([(0, 0, 0)]), means=leaf, scales=torch.zeros(1, 3))
    made = smoothed_segment(stretch_of(own), torch.zeros(3), 0.1).gaussians.scales
    made.sum().backward()
    assert bool(torch.isfinite(made).all() and torch.isfinite(leaf.grad).all())


def test_static_gaussians_shine_for_ever() -> None:
    made = native_segment(native(), -0.5, 0.5, 0.7).moving
    standing = [0, 3, 4, 6, 9, 10]
    assert not made.velocities[standing].any()
    assert bool(made.time_deviations_s[standing].isinf().all())
    assert isinstance(native().motion, SpacetimeMotion)

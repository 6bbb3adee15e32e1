"""One search bvh for many states: it changes no bit of any answer, whatever has moved since."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_trace import ANSWERS, MOTION, PARAMETERS, bundle, leaves, motion, scene

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.bvh.bvh import Bvh, TimedGaussians
from diff4splat.render.trace.bvh.bvh_build import build_bvh
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

RULES = TraceSettings()


def cloud_of(count: int = 60, seed: int = 0) -> Gaussians:
    return scene(count, seed, dtype=torch.float32)


def motion_of(count: int = 60, seed: int = 0) -> MovingCloud:
    return motion(count, seed, torch.float32)


def rays_at(earliest_s: float = 0.0, latest_s: float = 1.0, count: int = 60) -> Rays:
    rays = bundle(count, dtype=torch.float32)
    return replace(rays, time_s=torch.linspace(earliest_s, latest_s, count))


def assert_bvh_changes_nothing(
    bvh: Bvh,
    cloud: Gaussians,
    rays: Rays,
    moving: MovingCloud | None = None,
    rules: TraceSettings = RULES,
) -> int:
    """Equal bits of every answer; returns how many hits there are."""
    asked = {"outputs": ANSWERS, "settings": rules, "moving": moving}
    want = trace(cloud, rays, **asked)
    made = trace(cloud, rays, bvh=bvh, **asked)
    for name in ANSWERS:
        assert torch.equal(getattr(made, name), getattr(want, name)), name
    assert made.dropped_by_parameter == want.dropped_by_parameter
    return int(made.hits.sum())


def moved(cloud: Gaussians, seed: int, far: float) -> Gaussians:
    """Elsewhere, turned, of other sizes and opacities; many cross the cutoff."""
    generator = torch.Generator().manual_seed(seed)

    def noise(like: torch.Tensor) -> torch.Tensor:
        return torch.randn(like.shape, generator=generator)

    return replace(
        cloud,
        means=cloud.means + far * noise(cloud.means),
        quats=cloud.quats + noise(cloud.quats),
        scales=cloud.scales * noise(cloud.scales).exp(),
        opacities=(cloud.opacities + 0.5 * noise(cloud.opacities)).clamp(0, 1),
    )


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 400),
    st.integers(0, 10_000),
    st.sampled_from([0.0, 0.01, 1.0, 100.0]),
    st.sampled_from([1e-7, 0.1, 1.0, 100.0]),
    st.booleans(),
)
def test_a_tree_of_some_states_serves_any_state(
    count: int, seed: int, far: float, size: float, moves: bool
) -> None:
    first = cloud_of(count, seed)
    first = replace(first, scales=size * first.scales)
    clouds = [first, moved(first, seed, far), moved(first, seed + 1, far)]
    moving = motion_of(count, seed) if moves else None
    times = {"earliest_s": 0.0, "latest_s": 0.5}
    bvh = build_bvh(
        [TimedGaussians(gaussians=each, moving=moving, **times) for each in clouds[:2]], RULES
    )
    for cloud in clouds:
        assert_bvh_changes_nothing(bvh, cloud, rays_at(0.0, 0.5, 20), moving)


def test_a_tree_is_used_and_lists_neighbours() -> None:
    cloud, moving = cloud_of(900), motion_of(900)
    bvh = build_bvh([TimedGaussians(gaussians=cloud, moving=moving, latest_s=1.0)], RULES)
    visible = (cloud.opacities >= RULES.alpha_cutoff).sum()
    assert sorted(bvh.order.tolist()) == sorted(set(bvh.order.tolist()))
    assert len(bvh.order) == int(visible)
    assert assert_bvh_changes_nothing(bvh, cloud, rays_at(), moving) > 100
    # An order in which everybody's neighbours are strangers is as right.
    strangers = replace(bvh, order=np.random.default_rng(0).permutation(bvh.order))
    assert assert_bvh_changes_nothing(strangers, cloud, rays_at(), moving) > 100


def test_rays_may_look_at_times_that_no_state_had() -> None:
    cloud, moving = cloud_of(), replace(motion_of(), velocities=30 * motion_of().velocities)
    moving = replace(moving, time_deviations_s=torch.full((60,), math.inf))
    bvh = build_bvh(
        [TimedGaussians(gaussians=cloud, moving=moving, earliest_s=0.0, latest_s=0.01)], RULES
    )
    for earliest_s in (-0.2, 0.0, 0.2):
        assert assert_bvh_changes_nothing(bvh, cloud, rays_at(earliest_s, 0.3), moving) > 10


def test_gaussians_that_appear_are_found_and_those_that_vanish_are_not() -> None:
    cloud = cloud_of()
    odd = torch.arange(60) % 2 == 1
    seen = replace(cloud, opacities=torch.full((60,), 0.8))
    half = replace(seen, opacities=torch.where(odd, 0.8, 1e-4))
    other = replace(seen, opacities=torch.where(odd, 1e-4, 0.8))
    bvh = build_bvh([TimedGaussians(gaussians=half)], RULES)
    assert sorted(bvh.order.tolist()) == odd.nonzero().squeeze(1).tolist()
    hits = [assert_bvh_changes_nothing(bvh, each, bundle(60, dtype=torch.float32))
            for each in (half, other, seen)]  # fmt: skip
    assert hits[2] > max(hits[:2]) > 10
    nothing = replace(seen, opacities=torch.zeros(60))
    assert assert_bvh_changes_nothing(bvh, nothing, bundle(60, dtype=torch.float32)) == 0
    blind = build_bvh([TimedGaussians(gaussians=nothing)], RULES)
    assert len(blind.order) == 0
    assert assert_bvh_changes_nothing(blind, seen, bundle(60, dtype=torch.float32)) == hits[2]
    both = build_bvh([TimedGaussians(gaussians=half), TimedGaussians(gaussians=other)], RULES)
    assert len(both.order) == 60


def test_settings_of_the_tree_need_not_be_those_of_the_rays() -> None:
    cloud, rays = cloud_of(), bundle(60, dtype=torch.float32)
    bvh = build_bvh(
        [TimedGaussians(gaussians=cloud)], TraceSettings(alpha_cutoff=0.9, alpha_max=0.99)
    )
    for rules in (TraceSettings(alpha_cutoff=1e-5), TraceSettings.preset_3dgrt()):
        assert assert_bvh_changes_nothing(bvh, cloud, rays, rules=rules) > 10


@pytest.mark.parametrize("broken_first", [(), (0, 7, 59), tuple(range(60))])
@pytest.mark.parametrize("broken_then", [(), (0, 8), tuple(range(30, 60))])
def test_other_gaussians_may_be_unusable_than_when_the_tree_was_made(
    broken_first: tuple[int, ...], broken_then: tuple[int, ...]
) -> None:
    def broken(cloud: Gaussians, which: tuple[int, ...]) -> Gaussians:
        means = cloud.means.clone()
        means[list(which)] = math.nan
        return replace(cloud, means=means)

    cloud, moving, rays = cloud_of(), motion_of(), rays_at()
    moving = replace(moving, time_centers_s=moving.time_centers_s.clone())
    bvh = build_bvh([TimedGaussians(gaussians=broken(cloud, broken_first), moving=moving)], RULES)
    assert not set(broken_first) & set(bvh.order.tolist())
    moving.time_centers_s[5] = math.inf
    hits = assert_bvh_changes_nothing(bvh, broken(cloud, broken_then), rays, moving)
    assert hits > 5


def test_gradients_are_those_of_an_own_tree() -> None:
    cloud, moving, rays = cloud_of(300), motion_of(300), rays_at()
    bvh = build_bvh([TimedGaussians(gaussians=moved(cloud, 1, 1.0), moving=moving)], RULES)
    found = []
    for given_bvh in (None, bvh):
        own, own_motion = leaves(cloud), leaves(moving)
        made = trace(
            own, rays, outputs=("rgb", "distance"), moving=own_motion, bvh=given_bvh
        )  # fmt: skip
        (made.rgb.square().sum() + made.distance.sum()).backward()
        found.append([getattr(own, n).grad for n in PARAMETERS]
                     + [getattr(own_motion, n).grad for n in MOTION])  # fmt: skip
    assert bool(found[0][0].any())
    for one, other in zip(*found, strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize("backend", ["auto", "reference"])
def test_a_tree_of_another_scene_is_refused(backend: str) -> None:
    bvh = build_bvh([TimedGaussians(gaussians=cloud_of(50))], RULES)
    with pytest.raises(ConfigError, match="bvh: expected one of 60 Gaussians, got one of 50"):
        trace(cloud_of(), bundle(dtype=torch.float32), bvh=bvh, backend=backend)


def test_brute_force_needs_no_tree() -> None:
    cloud, rays = cloud_of(), bundle(dtype=torch.float32)
    bvh = build_bvh([TimedGaussians(gaussians=cloud)], RULES)
    want = trace(cloud, rays, backend="reference").rgb
    assert torch.equal(trace(cloud, rays, backend="reference", bvh=bvh).rgb, want)
    # Nor does double precision, and a bvh made there serves the compiled tracer all the same.
    empty = build_bvh([TimedGaussians(gaussians=cloud.to(torch.float64))], RULES)
    assert len(empty.order) == 0
    assert_bvh_changes_nothing(empty, cloud, rays)
    assert_bvh_changes_nothing(bvh, cloud.to(torch.float64), bundle())


@pytest.mark.usefixtures("as_shipped")
def test_states_that_do_not_fit_are_refused() -> None:
    cloud = cloud_of()
    with pytest.raises(InputError, match="build_bvh: expected states of one scene, got none"):
        build_bvh([], RULES)
    with pytest.raises(InputError, match=r"expected states of one scene, got \[50, 60\]"):
        build_bvh([TimedGaussians(gaussians=cloud), TimedGaussians(gaussians=cloud_of(50))], RULES)
    with pytest.raises(InputError, match="TimedGaussians: expected finite times"):
        TimedGaussians(gaussians=cloud, earliest_s=1.0, latest_s=0.0)
    with pytest.raises(InputError, match="TimedGaussians: expected finite times"):
        TimedGaussians(gaussians=cloud, latest_s=math.nan)
    with pytest.raises(
        ShapeError, match=r"TimedGaussians.moving: expected as many as Gaussians, 60, got 3"
    ):
        TimedGaussians(gaussians=cloud, moving=motion_of(3))


def test_the_order_of_some_has_their_own_numbers() -> None:
    bvh = Bvh(order=np.array([4, 0, 3, 1], np.int32), count=5)
    kept = torch.tensor([True, False, True, True, True])
    assert bvh.select(kept).tolist() == [3, 0, 2]
    assert bvh.select(kept | True).tolist() == [4, 0, 3, 1]

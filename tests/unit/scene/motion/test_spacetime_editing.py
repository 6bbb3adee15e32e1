"""Editing scenes of native 4D Gaussians commutes with time."""

import math
from dataclasses import fields, replace

import oracles_io
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_spacetime import motion, normal, still_gaussians

from diff4splat.errors import ConfigError
from diff4splat.geometry import quaternion
from diff4splat.scene.edit import Similarity, merge, simplify_motion, transform, transform_gaussians
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

F64 = torch.float64
TIMES_S = (-1.0, 0.0, 0.3, 1.1, 2.0, 5.0)


def scene(gaussians: Gaussians, moving: Motion) -> Scene:
    return Scene(
        gaussians=gaussians,
        motion=moving,
        path=oracles_io.camera_path(dtype=F64),
        provenance=Provenance(generator="test"),
    )


def moving_scene(seed: int = 0, waves: int = 2, bands: int = 4) -> Scene:
    return scene(still_gaussians(5, bands, seed), motion([1, 3, 4], seed, waves, bands))


def assert_same(left: Gaussians, right: Gaussians) -> None:
    for field in fields(Gaussians):
        got, want = getattr(left, field.name), getattr(right, field.name)
        if field.name == "quats":  # q and -q are the same rotation
            got, want = quaternion.to_matrix(got), quaternion.to_matrix(want)
        torch.testing.assert_close(got, want)


def assert_same_at_all_times(left: Scene, right: Scene) -> None:
    for time_s in TIMES_S:
        assert_same(left.state_at(time_s), right.state_at(time_s))


def halves(merged: Scene, count: int) -> tuple[Scene, Scene]:
    first = torch.arange(len(merged.gaussians)) < count
    return merged.select(first), merged.select(~first)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 999),
    scale=st.floats(1e-3, 1e3),
    waves=st.integers(0, 2),
    bands=st.sampled_from([1, 4, 16]),
    time_s=st.floats(-0.5, 2.5),
)
def test_transform_commutes_with_time(
    seed: int, scale: float, waves: int, bands: int, time_s: float
) -> None:
    start = moving_scene(seed, waves, bands)
    move = Similarity(
        rotation=normal(4, seed=seed), translation=normal(3, seed=seed + 1), scale=scale
    )
    moved = transform(start, move)
    assert_same(moved.state_at(time_s), transform_gaussians(start.state_at(time_s), move))
    torch.testing.assert_close(
        moved.motion.velocity_at(moved.gaussians, 1.0),
        scale * move.directions(start.motion.velocity_at(start.gaussians, 1.0)),
    )


@pytest.mark.parametrize("waves", [(0, 0), (0, 2), (1, 0), (2, 1), (2, 2)])
def test_merge_then_select_gives_the_parts(waves: tuple[int, int]) -> None:
    first, second = moving_scene(0, waves[0]), moving_scene(50, waves[1])
    merged = merge(first, second)
    assert merged.motion.moving_index.tolist() == [1, 3, 4, 6, 8, 9]
    for part, original in zip(halves(merged, 5), (first, second), strict=True):
        assert_same_at_all_times(part, original)


@pytest.mark.parametrize("static_first", [True, False])
@pytest.mark.parametrize("waves", [0, 2])
def test_merge_with_a_static_scene(static_first: bool, waves: int) -> None:
    parts = [
        scene(still_gaussians(4, seed=40), StaticMotion(time_range_s=(-9.0, 9.0))),
        moving_scene(waves=waves),
    ]
    first, second = parts if static_first else parts[::-1]
    merged = merge(first, second)
    assert merged.motion.time_range_s == (0.0, 2.0)
    for part, original in zip(halves(merged, len(first.gaussians)), (first, second), strict=True):
        assert_same_at_all_times(part, original)


@pytest.mark.parametrize("static", [True, False])
def test_merge_pads_the_harmonics_of_waves(static: bool) -> None:
    start = moving_scene(bands=1)
    other = scene(still_gaussians(2, 9), StaticMotion() if static else motion([0], 9, 1, 9))
    merged = merge(start, other)
    assert merged.motion.color_waves.shape[2] == 9
    back = halves(merged, 5)[0].state_at(0.4)
    torch.testing.assert_close(back.sh[:, :1], start.state_at(0.4).sh)
    assert not bool(back.sh[:, 1:].any())


def test_merge_takes_the_precision_of_the_first() -> None:
    merged = merge(moving_scene().to(torch.float32), moving_scene())
    assert merged.motion.color_waves.dtype == torch.float32
    assert len(merged.state_at(0.3)) == 10


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"time_range_s": (0.0, 3.0)}, r"same time_range_s in both motions, got \(0.0, 2.0\) and"),
        ({"gate": 0.0}, "same gate in both motions, got 0.05 and 0.0"),
        ({"period_s": 2.0}, "same period_s in both motions, got 1.7 and 2.0"),
    ],
)
def test_motions_without_a_common_form_do_not_merge(changes: dict, says: str) -> None:
    first, second = moving_scene(), moving_scene(50)
    second = replace(second, motion=replace(second.motion, **changes))
    with pytest.raises(ConfigError, match=says):
        merge(first, second)


def test_periods_may_differ_where_there_are_no_waves() -> None:
    first, second = moving_scene(waves=0), moving_scene(50)
    second = replace(second, motion=replace(second.motion, period_s=9.0))
    for merged in (merge(first, second), merge(second, first)):
        assert merged.motion.period_s == 9.0
    assert_same_at_all_times(halves(merge(first, second), 5)[1], second)


@pytest.mark.parametrize("keyed_first", [True, False])
def test_key_frames_and_pulses_do_not_merge(keyed_first: bool) -> None:
    keyed = oracles_io.scene(dtype=F64)
    parts = (keyed, moving_scene()) if keyed_first else (moving_scene(), keyed)
    with pytest.raises(ConfigError, match="beside native 4D motion, got KeyframeMotion"):
        merge(*parts)


def resting(**changes: object) -> SpacetimeMotion:
    """Two Gaussians that stand and are always there, but for ``changes``."""
    still = SpacetimeMotion(
        moving_index=torch.tensor([0, 2]),
        velocities=torch.zeros(2, 3, dtype=F64),
        time_centers_s=torch.tensor([0.0, 3.0], dtype=F64),
        time_deviations_s=torch.full((2,), math.inf, dtype=F64),
        time_range_s=(0.0, 2.0),
    )
    return replace(still, **changes)


def kept(moving: SpacetimeMotion, **tolerances: float) -> list[int]:
    """Who still moves after what stands was let stand."""
    start = scene(replace(still_gaussians(3), opacities=torch.full((3,), 0.5).double()), moving)
    return simplify_motion(start, **tolerances).motion.moving_index.tolist()


def test_what_never_changes_becomes_static() -> None:
    start = scene(still_gaussians(3), resting())
    assert simplify_motion(start).motion == StaticMotion(time_range_s=(0.0, 2.0))
    assert_same_at_all_times(simplify_motion(start), start)
    one = resting(velocities=torch.tensor([[0.0, 0, 0], [0, 1, 0]], dtype=F64))
    left = simplify_motion(scene(still_gaussians(3), one))
    assert left.motion.moving_index.tolist() == [2]
    assert_same_at_all_times(left, scene(still_gaussians(3), one))


def test_offsets_are_judged_at_the_time_farthest_from_the_centre() -> None:
    slow = resting(velocities=torch.full((2, 3), 0.01 / math.sqrt(3), dtype=F64))
    assert kept(slow) == [0, 2]
    assert kept(slow, offset=0.021) == [2]
    assert kept(slow, offset=0.031) == []


def test_opacities_are_judged_at_the_time_farthest_from_the_centre() -> None:
    fading = resting(time_deviations_s=torch.full((2,), 5.0, dtype=F64))
    losses = [0.5 * (1 - math.exp(-0.5 * (longest / 5) ** 2)) for longest in (2, 3)]
    assert kept(fading) == [0, 2]
    assert kept(fading, opacity=losses[0] + 1e-9) == [2]
    assert kept(fading, opacity=losses[1] + 1e-9) == []
    assert kept(resting(time_deviations_s=torch.full((2,), 1e-3, dtype=F64)), opacity=0.49) == [
        0,
        2,
    ]


def test_a_colour_wave_and_broken_numbers_are_never_still() -> None:
    waves = torch.zeros(2, 2, 4, 3, dtype=F64)
    assert kept(resting(color_waves=waves)) == []
    waves[1, 1, 2, 0] = -1e-9
    assert kept(resting(color_waves=waves), offset=9.0, opacity=1.0) == [2]
    broken = torch.tensor([[0, math.nan, 0], [0, 0, 0]], dtype=F64)
    assert kept(resting(velocities=broken), offset=9.0, opacity=1.0) == [0]


def test_nobody_moving_becomes_static() -> None:
    start = scene(still_gaussians(3), motion([]))
    assert isinstance(simplify_motion(start).motion, StaticMotion)

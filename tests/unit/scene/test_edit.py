"""Laws that hold without rendering anything."""

import math
from dataclasses import fields, replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.scene import harmonics
from diff4splat.scene.edit import (
    Box,
    Similarity,
    crop,
    merge,
    prune,
    simplify_motion,
    transform,
    transform_gaussians,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframe_algebra import resample
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

F64 = torch.float64
EVERYWHERE = Box(low=(-math.inf,) * 3, high=(math.inf,) * 3)


def normal(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=F64)


def gaussians(count: int, degree: int = 0, seed: int = 0) -> Gaussians:
    return Gaussians(
        means=normal(count, 3, seed=seed),
        quats=quaternion.normalize(normal(count, 4, seed=seed + 1)),
        scales=normal(count, 3, seed=seed + 2).exp(),
        opacities=normal(count, seed=seed + 3).sigmoid(),
        sh=normal(count, harmonics.BAND_SIZES[degree], 3, seed=seed + 4),
    )


def keyframes(times: list[float], index: list[int], seed: int = 0, **changes) -> KeyframeMotion:
    shape = (len(times), len(index))
    motion = KeyframeMotion(
        key_times_s=torch.tensor(times, dtype=F64),
        moving_index=torch.tensor(index, dtype=torch.long),
        offsets=normal(*shape, 3, seed=seed),
        rotations=quaternion.normalize(normal(*shape, 4, seed=seed + 1)),
        log_scale_offsets=0.3 * normal(*shape, 3, seed=seed + 2),
    )
    return replace(motion, **changes)


def path() -> CameraPath:
    axes = torch.nn.functional.normalize(normal(3, 3, seed=5), dim=-1)
    turns = quaternion.to_matrix(quaternion.from_axis_angle(axes, normal(3, seed=6)))
    poses = rigid.from_parts(turns, normal(3, 3, seed=7))
    cameras = pinhole(50.0, (20, 30), dtype=F64).with_pose(poses)
    return CameraPath(cameras=cameras, times_s=torch.tensor([0.0, 0.5, 1.0], dtype=F64))


def scene(parts: Gaussians, motion: object = None, **provenance) -> Scene:
    return Scene(
        gaussians=parts,
        motion=StaticMotion() if motion is None else motion,
        path=path(),
        provenance=Provenance(generator="test", **provenance),
    )


def moving_scene(count: int = 5, degree: int = 1, seed: int = 0) -> Scene:
    return scene(gaussians(count, degree, seed), keyframes([0.0, 0.4, 1.0], [1, 3], seed))


def similarity(seed: int = 0, scale: float = 1.7) -> Similarity:
    return Similarity(rotation=normal(4, seed=seed), translation=normal(3, seed=9), scale=scale)


def assert_same(left: Gaussians, right: Gaussians, what: str = "") -> None:
    for field in fields(Gaussians):
        got, want = getattr(left, field.name), getattr(right, field.name)
        if field.name == "quats":  # q and -q are the same rotation
            got, want = quaternion.to_matrix(got), quaternion.to_matrix(want)
        torch.testing.assert_close(got, want, msg=lambda m, f=field: f"{what} {f.name}: {m}")


def assert_same_at_all_times(left: Scene, right: Scene) -> None:
    for time_s in (-1.0, 0.0, 0.1, 0.4, 0.55, 0.9, 1.0, 3.0):
        assert_same(left.state_at(time_s), right.state_at(time_s), f"at {time_s} s:")


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 999), scale=st.floats(1e-3, 1e3), degree=st.integers(0, 3))
def test_a_transform_and_its_inverse_are_the_identity(seed: int, scale: float, degree: int) -> None:
    start, move = moving_scene(degree=degree), similarity(seed, scale)
    back = transform(transform(start, move), move.inverse())
    assert_same_at_all_times(back, start)
    torch.testing.assert_close(
        back.path.cameras.world_from_camera, start.path.cameras.world_from_camera
    )


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 999), time_s=st.floats(-0.5, 1.5))
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_transform_commutes_with_time(interpolation: str, seed: int, time_s: float) -> None:
    start, move = moving_scene(), similarity(seed)
    start = replace(start, motion=replace(start.motion, interpolation=interpolation))
    got = transform(start, move).state_at(time_s)
    assert_same(got, transform_gaussians(start.state_at(time_s), move))


def test_transform_carries_covariances_and_colours_along() -> None:
    """Σ' = s² R Σ Rᵀ, and the colour towards R d is the old colour towards d."""
    start, move = gaussians(4, degree=3), similarity()
    turn = quaternion.to_matrix(move.rotation)
    after = transform_gaussians(start, move)

    def covariance(parts: Gaussians) -> torch.Tensor:
        axes = quaternion.to_matrix(parts.quats) * parts.scales[:, None]
        return axes @ axes.mT

    want = move.scale**2 * turn @ covariance(start) @ turn.mT
    torch.testing.assert_close(covariance(after), want)
    torch.testing.assert_close(after.means, move.scale * start.means @ turn.mT + move.translation)
    directions = torch.nn.functional.normalize(normal(4, 3, seed=8), dim=-1)
    torch.testing.assert_close(
        harmonics.color(after.sh, directions @ turn.mT), harmonics.color(start.sh, directions)
    )
    assert torch.equal(after.opacities, start.opacities)


def test_cameras_see_the_transformed_scene_as_before() -> None:
    start, move = moving_scene(), similarity()
    after = transform(start, move)
    require_valid_path(after.path, "transformed path")
    before_px, before_z = project(start.path.cameras[1], start.gaussians.means)
    after_px, after_z = project(after.path.cameras[1], after.gaussians.means)
    torch.testing.assert_close(after_px, before_px)
    torch.testing.assert_close(after_z, move.scale * before_z)


def test_the_identity_changes_nothing() -> None:
    start = moving_scene(degree=3)
    still = Similarity(rotation=torch.zeros(4, dtype=F64), translation=torch.zeros(3, dtype=F64))
    assert_same_at_all_times(transform(start, still), start)


def test_a_zero_quaternion_turns_like_the_others() -> None:
    unturned = replace(gaussians(1), quats=torch.zeros(1, 4, dtype=F64))
    after = transform_gaussians(unturned, similarity())
    torch.testing.assert_close(
        quaternion.to_matrix(after.quats)[0], quaternion.to_matrix(similarity().rotation)
    )


def test_transform_keeps_the_precision_of_the_scene() -> None:
    start = moving_scene(degree=2).to(torch.float32)
    after = transform(start, similarity())
    assert {getattr(after.gaussians, f.name).dtype for f in fields(Gaussians)} == {torch.float32}
    assert after.motion.offsets.dtype == torch.float32
    want = transform_gaussians(start.gaussians.to(F64), similarity())
    assert_same(after.gaussians, want.to(torch.float32))


def test_transform_has_gradients() -> None:
    parts = gaussians(2, degree=1)

    def change(means: torch.Tensor, quats: torch.Tensor, sh: torch.Tensor) -> torch.Tensor:
        after = transform_gaussians(replace(parts, means=means, quats=quats, sh=sh), similarity())
        return torch.cat([after.means.flatten(), after.quats.flatten(), after.sh.flatten()])

    inputs = [tensor.requires_grad_() for tensor in (parts.means, parts.quats, parts.sh)]
    assert torch.autograd.gradcheck(change, inputs)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_refuses_a_scale_that_is_not_positive(scale: float) -> None:
    with pytest.raises(InputError, match=r"Similarity.scale: expected a finite number above 0"):
        similarity(scale=scale)


def test_refuses_a_transform_with_nan() -> None:
    with pytest.raises(InputError, match="expected a finite rotation and translation"):
        Similarity(rotation=torch.full((4,), math.nan), translation=torch.zeros(3))


class Drift:
    """A motion that edits know nothing about."""

    time_range_s = (0.0, 1.0)
    moving_index = torch.zeros(0, dtype=torch.long)

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        return replace(gaussians, means=gaussians.means + time_s)

    def select(self, kept: torch.Tensor) -> "Drift":
        return self

    def to(self, target: object) -> "Drift":
        return self


def test_refuses_motions_it_does_not_know() -> None:
    drifting = scene(gaussians(2), Drift())
    with pytest.raises(ConfigError, match="transform: expected static or key-framed motion, got D"):
        transform(drifting, similarity())
    with pytest.raises(ConfigError, match="merge: expected static or key-framed motion, got Drift"):
        merge(moving_scene(), drifting)
    assert simplify_motion(drifting) is drifting


def test_crop_keeps_what_lies_inside_with_its_motion() -> None:
    start = moving_scene(8)
    box = Box(low=(-math.inf, -1.0, -1.0), high=(0.5, 1.0, math.inf))
    x, y, z = start.gaussians.means.unbind(1)
    inside = (x <= 0.5) & (y.abs() <= 1) & (z >= -1)
    assert 0 < int(inside.sum()) < 8
    assert_same_at_all_times(crop(start, box), start.select(inside))


def test_crop_includes_the_border_and_may_leave_nothing() -> None:
    start = moving_scene()
    corner = tuple(start.gaussians.means[2].tolist())
    assert len(crop(start, Box(low=corner, high=corner)).gaussians) == 1
    nothing = crop(start, Box(low=(90.0, 90.0, 90.0), high=(91.0, 91.0, 91.0)))
    assert len(nothing.gaussians) == len(nothing.state_at(0.7)) == 0
    assert len(crop(nothing, EVERYWHERE).gaussians) == 0
    assert_same_at_all_times(crop(start, EVERYWHERE), start)


@pytest.mark.parametrize("low", [(0.0, 2.0, 0.0), (0.0, math.nan, 0.0)])
def test_refuses_a_box_inside_out(low: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="Box: expected low <= high on each axis"):
        Box(low=low, high=(1.0, 1.0, 1.0))


def test_prune_keeps_order_and_motion() -> None:
    start = moving_scene(6)
    opacities = torch.tensor([0.9, 0.004, 0.005, 0.0, 1.0, math.nan], dtype=F64)
    start = replace(start, gaussians=replace(start.gaussians, opacities=opacities))
    pruned = prune(start)
    assert pruned.gaussians.opacities.tolist() == [0.9, 0.005, 1.0]
    assert_same_at_all_times(
        pruned, start.select(torch.tensor([True, False, True, False, True, False]))
    )


def test_prune_at_zero_keeps_everything() -> None:
    assert_same_at_all_times(prune(moving_scene(), 0.0), moving_scene())


@pytest.mark.parametrize("threshold", [-0.1, 1.1, math.nan])
def test_refuses_an_opacity_that_is_none(threshold: float) -> None:
    with pytest.raises(ConfigError, match=r"min_opacity: expected a number in \[0, 1\]"):
        prune(moving_scene(), threshold)


def test_still_gaussians_lose_their_keys() -> None:
    motion = keyframes([0.0, 1.0], [0, 1, 2, 4])
    offsets, stretch = motion.offsets.clone(), motion.log_scale_offsets.clone()
    rotations = quaternion.identity_like(motion.rotations).clone()
    offsets[:, [0, 2, 3]], stretch[:, [0, 1, 3]] = 0.0, 0.0
    rotations[1, 3] = quaternion.normalize(torch.tensor([-1.0, 0.0, 1e-3, 0.0], dtype=F64))
    motion = replace(motion, offsets=offsets, rotations=rotations, log_scale_offsets=stretch)
    start = scene(gaussians(5), motion)
    exact = simplify_motion(start)
    assert exact.motion.moving_index.tolist() == [1, 2, 4]
    assert_same_at_all_times(exact, start)
    assert simplify_motion(start, angle_rad=2.1e-3).motion.moving_index.tolist() == [1, 2]
    assert simplify_motion(start, angle_rad=1.9e-3).motion.moving_index.tolist() == [1, 2, 4]
    far = float(offsets[:, 1].norm(dim=-1).max())
    less = simplify_motion(start, offset=1.01 * far, angle_rad=1.0)
    assert less.motion.moving_index.tolist() == [2]
    assert simplify_motion(start, offset=0.99 * far).motion.moving_index.tolist() == [1, 2, 4]


def test_a_change_in_one_component_at_the_last_key_counts() -> None:
    quiet = torch.zeros(3, 1, 3, dtype=F64)
    stretch = quiet.clone()
    stretch[2, 0, 1] = -0.2
    motion = keyframes([0.0, 0.5, 1.0], [0], offsets=quiet, log_scale_offsets=stretch)
    motion = replace(motion, rotations=quaternion.identity_like(motion.rotations))
    start = scene(gaussians(1), motion)
    assert simplify_motion(start, log_scale=0.19).motion.moving_index.tolist() == [0]
    assert isinstance(simplify_motion(start, log_scale=0.21).motion, StaticMotion)


def test_what_does_not_move_at_all_becomes_static() -> None:
    start = moving_scene()
    still = simplify_motion(start, offset=100.0, angle_rad=10.0, log_scale=100.0)
    assert still.motion == StaticMotion(time_range_s=(0.0, 1.0))
    nothing = scene(gaussians(2), keyframes([0.0, 1.0], []))
    assert isinstance(simplify_motion(nothing).motion, StaticMotion)
    assert simplify_motion(still) is still


@pytest.mark.parametrize("part", ["offsets", "log_scale_offsets"])
def test_damaged_keys_are_not_called_still(part: str) -> None:
    motion = keyframes([0.0, 1.0], [0])
    broken = replace(motion, **{part: torch.full_like(getattr(motion, part), math.nan)})
    kept = simplify_motion(scene(gaussians(1), broken), offset=9.0, angle_rad=9.0, log_scale=9.0)
    assert kept.motion.moving_index.tolist() == [0]


@settings(max_examples=25, deadline=None)
@given(extra=st.lists(st.floats(-0.5, 2.0), max_size=4), time_s=st.floats(-1.0, 2.5))
def test_resampling_a_linear_motion_is_exact(extra: list[float], time_s: float) -> None:
    start = moving_scene()
    times = torch.tensor([*extra, 0.0, 0.4, 1.0], dtype=F64).unique()
    finer = replace(start, motion=resample(start.motion, times))
    assert_same(finer.state_at(time_s), start.state_at(time_s))


def test_resampling_handles_one_key_and_none_moving() -> None:
    one = scene(gaussians(2), keyframes([0.5], [1]))
    finer = replace(one, motion=resample(one.motion, torch.tensor([0.0, 1.0])))
    assert_same_at_all_times(finer, one)
    nobody = resample(keyframes([0.0, 1.0], []), torch.tensor([0.0, 0.5, 1.0]))
    assert nobody.offsets.shape == (3, 0, 3)


def test_a_cubic_motion_becomes_linear_between_its_samples() -> None:
    cubic = scene(gaussians(2), keyframes([0.0, 0.4, 1.0], [1], interpolation="cubic"))
    sampled = replace(cubic, motion=resample(cubic.motion, torch.tensor([0.0, 0.2, 0.8, 1.0])))
    for time_s in (0.0, 0.2, 0.8, 1.0):
        assert_same(
            sampled.state_at(time_s).to(torch.float32), cubic.state_at(time_s).to(torch.float32)
        )
    ends = [sampled.state_at(time_s).means for time_s in (0.2, 0.8)]
    torch.testing.assert_close(sampled.state_at(0.5).means, (ends[0] + ends[1]) / 2)


def halves(merged: Scene, count: int) -> tuple[Scene, Scene]:
    first = torch.arange(len(merged.gaussians)) < count
    return merged.select(first), merged.select(~first)


@pytest.mark.parametrize("times", [[0.0, 0.4, 1.0], [0.2, 0.4, 2.0], [0.5], [-1.0, 3.0]])
def test_merge_then_select_gives_the_parts(times: list[float]) -> None:
    first = moving_scene(4, degree=1)
    second = scene(gaussians(3, 1, seed=20), keyframes(times, [0, 2], seed=30))
    merged = merge(replace(first, dilation_px2=0.1), second)
    assert merged.motion.moving_index.tolist() == [1, 3, 4, 6] and merged.dilation_px2 == 0.1
    for part, original in zip(halves(merged, 4), (first, second), strict=True):
        assert_same_at_all_times(part, original)


@pytest.mark.parametrize("static_first", [True, False])
def test_merge_of_static_and_moving(static_first: bool) -> None:
    parts = [scene(gaussians(4, 1, seed=40)), moving_scene(5)]
    first, second = parts if static_first else parts[::-1]
    merged = merge(first, second)
    for part, original in zip(halves(merged, len(first.gaussians)), (first, second), strict=True):
        assert_same_at_all_times(part, original)


def test_merge_of_static_scenes_is_static() -> None:
    first = scene(gaussians(1), StaticMotion(time_range_s=(0.0, 2.0)))
    second = scene(gaussians(2), StaticMotion(time_range_s=(-1.0, 1.0)))
    assert merge(first, second).motion == StaticMotion(time_range_s=(-1.0, 2.0))


def test_merge_pads_harmonics_with_zeros() -> None:
    merged = merge(scene(gaussians(2, degree=0)), scene(gaussians(1, degree=2)))
    assert merged.gaussians.degree == 2
    assert bool((merged.gaussians.sh[:2, 1:] == 0).all())
    assert torch.equal(merged.gaussians.sh[:2, :1], gaussians(2).sh)


def test_merge_with_an_empty_scene() -> None:
    start = moving_scene()
    empty = start.select(torch.zeros(5, dtype=torch.bool))
    assert_same_at_all_times(merge(start, empty), start)
    assert_same_at_all_times(merge(empty, start), start)


def test_merge_takes_the_precision_of_the_first() -> None:
    merged = merge(moving_scene().to(torch.float32), moving_scene())
    assert merged.gaussians.means.dtype == merged.motion.offsets.dtype == torch.float32
    assert len(merged.state_at(0.3)) == 10


def test_cubic_motions_merge_only_on_the_same_keys() -> None:
    cubic = replace(moving_scene(), motion=keyframes([0.0, 0.4, 1.0], [1], interpolation="cubic"))
    merged = merge(cubic, cubic)
    assert merged.motion.interpolation == "cubic"
    assert_same_at_all_times(halves(merged, 5)[1], cubic)
    with pytest.raises(ConfigError, match=r"merge: expected linear key frames .*resample"):
        merge(cubic, moving_scene())


def test_merge_loses_no_licence() -> None:
    first = scene(gaussians(1), license="CC-BY-4.0", seed=1, model="a", prompt="cat")
    second = scene(gaussians(1), license="MIT", seed=2, model="a", prompt="cat", untrained=True)
    record = merge(first, second).provenance
    assert record.license == "CC-BY-4.0; MIT"
    assert (record.model, record.seed, record.prompt, record.untrained) == ("a", None, "cat", True)
    assert torch.equal(merge(first, second).path.times_s, first.path.times_s)

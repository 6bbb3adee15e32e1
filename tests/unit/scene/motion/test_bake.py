"""Key frames in place of other motions: errors in pixels, number of keys, what is lost."""

import math
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import pytest
import torch
from oracles_hexplane import F64, random_motion
from torch import Tensor

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.bake import bake, bake_within
from diff4splat.scene.motion.bake_error import BakeError, largest
from diff4splat.scene.motion.hexplane.decoder import DecoderSize, make_decoder
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.hexplane.planes import TEMPORAL, HexPlaneSize, make_planes
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion

BOX = torch.tensor([[-1.0, -1, 3], [1, 1, 5]])
CAMERA = pinhole(100.0, (90, 120), F64)


def cloud(count: int, dtype: torch.dtype = F64) -> Gaussians:
    """In front of the camera, some beside the image."""
    low, high = BOX.to(dtype)
    return Gaussians(
        means=low + torch.rand(count, 3, dtype=dtype) * (high - low),
        quats=torch.randn(count, 4, dtype=dtype),
        scales=torch.rand(count, 3, dtype=dtype) * 0.1 + 0.01,
        opacities=torch.rand(count, dtype=dtype) * 0.5 + 0.5,
        sh=torch.randn(count, 1, 3, dtype=dtype),
    )


@dataclass(frozen=True, kw_only=True)
class Swing:
    """Everything swings along x, turns about z and fades, as a sine and a cosine of time."""

    moving_index: Tensor
    reach: float = 0.3
    time_range_s: tuple[float, float] = (0.0, 2.0)

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        phase = 3.0 * time_s
        step = torch.zeros(3, dtype=gaussians.means.dtype)
        step[0] = self.reach * math.sin(phase)
        turn = torch.tensor([math.cos(0.2 * phase), 0, 0, math.sin(0.2 * phase)]).to(step)
        moved = replace(
            gaussians,
            means=gaussians.means + step,
            quats=quaternion.multiply(gaussians.quats, turn.expand_as(gaussians.quats)),
            opacities=gaussians.opacities * (1 - 0.25 * math.sin(phase) ** 2),
            sh=gaussians.sh + 0.5 * math.sin(phase),
        )
        still = torch.ones(len(gaussians), dtype=torch.bool)
        still[self.moving_index] = False
        return Gaussians(
            **{
                f.name: torch.where(
                    still.reshape(-1, *[1] * (getattr(moved, f.name).ndim - 1)),
                    getattr(gaussians, f.name),
                    getattr(moved, f.name),
                )
                for f in fields(Gaussians)
            }
        )

    def select(self, kept: Tensor) -> "Swing":
        survives = kept[self.moving_index]
        index = kept.long().cumsum(0)[self.moving_index[survives]] - 1
        return replace(self, moving_index=index)

    def to(self, target: object) -> "Swing":
        del target
        return self


def swing(count: int, **changes: object) -> Swing:
    return Swing(moving_index=torch.arange(count), **changes)


def field(strength: float, count: int, nodes: int = 12) -> HexPlaneMotion:
    """A random float32 field whose time planes are smooth in time, as those of a fit are."""
    size = HexPlaneSize(space=(8, 8, 8), time=nodes)
    planes = make_planes(size, BOX, (0.0, 2.0))
    clock = torch.linspace(0, 2 * math.pi, nodes)[:, None, None]
    levels = tuple(
        tuple(
            p + strength * torch.sin(clock + 6.28 * torch.rand(p.shape[1:])) if k in TEMPORAL else p
            for k, p in enumerate(level)
        )
        for level in planes.levels
    )
    decoder = make_decoder(planes.feature_count, DecoderSize(), zero_heads=False)
    return HexPlaneMotion(
        planes=replace(planes, levels=levels),
        decoder=decoder,
        moving_index=torch.arange(count),
    )


def centers_px(gaussians: Gaussians, camera: Camera) -> Tensor:
    """Projected by the camera's inverse pose."""
    points = torch.cat([gaussians.means, torch.ones(len(gaussians), 1).to(gaussians.means)], 1)
    x, y, z, _ = (points @ camera.camera_from_world.to(points).T).unbind(1)
    (fx, fy), (cx, cy) = camera.focal_px.to(points), camera.center_px.to(points)
    return torch.stack([fx * x / z + cx, fy * y / z + cy], 1)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_error_falls_with_the_square_of_the_distance_of_keys(interpolation: str) -> None:
    still = cloud(30)
    errors = [bake(still, swing(30), k, CAMERA, interpolation)[1] for k in (5, 9, 17)]
    for coarse, fine in pairwise(errors):
        assert coarse.largest_px > 3 * fine.largest_px
        assert coarse.quantile_px <= coarse.largest_px


def test_keys_are_exact_and_the_others_stand_still() -> None:
    still, motion = cloud(9), replace(swing(9), moving_index=torch.tensor([1, 4, 8]))
    baked, _ = bake(still, motion, [0.0, 0.3, 2.0], CAMERA)
    assert baked.moving_index.tolist() == [1, 4, 8]
    assert baked.key_times_s.tolist() == [0.0, 0.3, 2.0]
    for time_s in (0.0, 0.3, 2.0):
        got, want = baked.state_at(still, time_s), motion.state_at(still, time_s)
        torch.testing.assert_close(got.means, want.means)
        torch.testing.assert_close(got.scales, want.scales)
        matrices = [quaternion.to_matrix(state.quats) for state in (got, want)]
        torch.testing.assert_close(*matrices)


def test_key_frames_baked_at_their_own_keys_are_themselves() -> None:
    still = cloud(5)
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.5, 0.7, 2.0], dtype=F64),
        moving_index=torch.arange(5),
        offsets=torch.randn(4, 5, 3, dtype=F64) * 0.1,
        rotations=quaternion.normalize(torch.randn(4, 5, 4, dtype=F64)),
        log_scale_offsets=torch.randn(4, 5, 3, dtype=F64) * 0.1,
    )
    baked, error = bake(still, motion, motion.key_times_s.tolist(), CAMERA)
    assert error.largest_px < 1e-9
    torch.testing.assert_close(baked.offsets, motion.offsets)
    found, error = bake_within(still, motion, CAMERA, 1e-6)
    assert error.largest_px < 1e-9
    torch.testing.assert_close(found.key_times_s, motion.key_times_s)


def test_a_tenth_of_a_pixel_is_held_on_a_random_field() -> None:
    still, motion = cloud(300, torch.float32), field(0.3, 300)
    cameras = pinhole(400.0, (360, 480), F64)
    baked, error = bake_within(still, motion, cameras)
    assert 0 < error.quantile_px <= error.largest_px <= 0.1
    moved, strays = 0.0, 0.0
    for time_s in torch.rand(50).mul(2).tolist():
        want = centers_px(motion.state_at(still, time_s), cameras)
        inside = ((want >= 0) & (want <= torch.tensor([480, 360]))).all(1)
        got = centers_px(baked.state_at(still, time_s), cameras)
        strays = max(strays, float((got - want)[inside].norm(dim=1).max()))
        moved = max(moved, float((want - centers_px(still, cameras))[inside].norm(dim=1).max()))
    # Between the times that were looked at the error is no more than a little larger.
    assert strays <= 0.11 < moved


def test_slower_motion_needs_fewer_keys_and_even_motion_two() -> None:
    still = cloud(20)
    counts = [
        len(bake_within(still, swing(20, reach=reach), CAMERA, 0.1)[0].key_times_s)
        for reach in (0.003, 0.1)
    ]
    assert counts[0] < counts[1]
    assert len(bake_within(still, random_line(20), CAMERA, 1e-6)[0].key_times_s) == 2


def random_line(count: int) -> KeyframeMotion:
    """Even motion, told with keys that are not needed."""
    clock = torch.linspace(0, 2, 9, dtype=F64)
    offsets = clock[:, None, None] * torch.randn(count, 3, dtype=F64) * 0.05
    return KeyframeMotion(
        key_times_s=clock,
        moving_index=torch.arange(count),
        offsets=offsets,
        rotations=quaternion.identity_like(torch.zeros(9, count, 4, dtype=F64)),
        log_scale_offsets=torch.zeros_like(offsets),
    )


def test_keys_come_at_the_kinks_of_a_field_first() -> None:
    still, motion = cloud(100, torch.float32), field(0.3, 100, nodes=7)
    baked, _ = bake_within(still, motion, CAMERA, 0.5)
    nodes = torch.linspace(0, 2, 7)
    assert 2 < len(baked.key_times_s) <= 7
    assert float((baked.key_times_s[:, None] - nodes).abs().amin(1).max()) < 1e-6


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_tolerance_is_held_with_either_interpolation(interpolation: str) -> None:
    still, motion = cloud(10), swing(10)
    baked, error = bake_within(still, motion, CAMERA, 0.5, interpolation=interpolation)
    assert baked.interpolation == interpolation
    again = bake(still, motion, baked.key_times_s.tolist(), CAMERA, interpolation)[1]
    assert again.largest_px == pytest.approx(error.largest_px) and error.largest_px <= 0.5


def test_what_key_frames_cannot_hold_is_reported() -> None:
    still = cloud(4)
    _, error = bake(still, swing(4), 3, CAMERA)
    assert error.opacity_lost == pytest.approx(0.25 * float(still.opacities.max()), rel=1e-2)
    assert error.color_lost == pytest.approx(0.5, rel=1e-2)
    assert bake(still, field_without_colour(4), 5, CAMERA)[1].color_lost == 0


def field_without_colour(count: int) -> HexPlaneMotion:
    motion = random_motion(range(count), ("position", "rotation", "scale"))
    return replace(motion, planes=replace(motion.planes, time_range_s=(0.0, 2.0)))


def test_scales_of_zero_and_zero_quaternions_stay_finite() -> None:
    still = cloud(3)
    still = replace(still, scales=still.scales * 0, quats=still.quats * 0)
    baked, error = bake(still, swing(3), 5, CAMERA)
    assert math.isfinite(error.largest_px)
    for name in ("offsets", "rotations", "log_scale_offsets"):
        assert bool(torch.isfinite(getattr(baked, name)).all())


def test_nothing_moving_and_nothing_seen_are_no_error() -> None:
    still = cloud(3)
    for motion in (StaticMotion(time_range_s=(0.0, 1.0)), swing(0)):
        baked, error = bake_within(still, motion, CAMERA)
        assert len(baked.moving_index) == 0 and error == BakeError() == largest([])
        assert torch.equal(baked.state_at(still, 0.5).means, still.means)
    away = replace(still, means=still.means * torch.tensor([1.0, 1, -1]))
    baked, error = bake_within(away, swing(3), CAMERA)
    assert error.largest_px == error.quantile_px == 0 < error.color_lost


def test_a_range_of_one_moment_has_one_key() -> None:
    still = cloud(3)
    motion = swing(3, time_range_s=(0.5, 0.5))
    for baked, error in (bake(still, motion, 4, CAMERA), bake_within(still, motion, CAMERA)):
        assert baked.key_times_s.tolist() == [0.5] and error.largest_px < 1e-9


def test_keys_that_do_not_reach_the_ends_are_held_against_them() -> None:
    still, motion = cloud(5), swing(5)
    inner = bake(still, motion, [0.9, 0.95, 1.0], CAMERA)[1].largest_px
    whole = bake(still, motion, 41, CAMERA)[1].largest_px
    assert inner > 100 * whole


def test_gradients_do_not_reach_the_keys() -> None:
    motion = random_motion([0, 1], ("position",))
    learned = {name: tensor.clone().requires_grad_() for name, tensor in motion.tensors().items()}
    baked, _ = bake(cloud(2), motion.with_tensors(learned), 3, CAMERA)
    assert not baked.offsets.requires_grad


def test_too_few_keys_and_impossible_tolerances_are_refused() -> None:
    still = cloud(3)
    with pytest.raises(ConfigError, match="at most 8 keys"):
        bake_within(still, swing(3), CAMERA, 1e-3, max_keys=8)
    for tolerance_px in (0.0, -1.0, math.nan):
        with pytest.raises(ConfigError, match="tolerance_px"):
            bake_within(still, swing(3), CAMERA, tolerance_px)
    single = cloud(3, torch.float32)
    with pytest.raises(ConfigError, match="allow more of either"):
        bake_within(single, swing(3, time_range_s=(1.0, 1.000001)), CAMERA, 1e-12)


@pytest.mark.parametrize("keys", [0, [], [0.0, math.nan], [math.inf]])
def test_key_times_that_are_none_are_refused(keys: object) -> None:
    with pytest.raises(InputError, match="finite key time"):
        bake(cloud(2), swing(2), keys, CAMERA)


def test_motions_that_leave_finite_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="finite Gaussians at 0"):
        bake_within(cloud(2), swing(2, reach=math.nan), CAMERA)

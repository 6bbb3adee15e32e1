"""Frames that share work are the frames made one by one."""

from dataclasses import replace

import pytest
import torch
from oracles_render import random_gaussians

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render, render_video
from diff4splat.render.raster.raster_settings import make_raster_settings, make_view
from diff4splat.render.raster.sequence import Sequence
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

CAMERA = pinhole(40.0, (70, 90))
COUNT, FRAMES = 120, 5
OUTPUTS = ("rgb", "alpha", "depth", "median_depth")


def keyed(moving: torch.Tensor, interpolation: str = "linear") -> KeyframeMotion:
    """Random keys; some rotations are opposite quaternions, some equal."""
    count, times = len(moving), torch.tensor([0.0, 0.2, 0.7, 1.0])
    rotations = torch.randn(4, count, 4)
    rotations[2] = rotations[1]
    rotations[3] = -rotations[2] + 0.1 * torch.randn(count, 4)
    return KeyframeMotion(
        key_times_s=times,
        moving_index=moving,
        offsets=0.2 * torch.randn(4, count, 3),
        rotations=rotations,
        log_scale_offsets=0.3 * torch.randn(4, count, 3),
        interpolation=interpolation,
    )


def scene_with(motion, turning: bool = False, bands: int = 4) -> Scene:
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    if turning:
        poses[:, 0, 3] = torch.linspace(-0.3, 0.3, FRAMES)
    path = CameraPath(cameras=CAMERA.with_pose(poses), times_s=torch.linspace(0.0, 1.1, FRAMES))
    gaussians = random_gaussians(COUNT, bands=bands, dtype=torch.float32)
    gaussians = replace(gaussians, scales=0.4 * gaussians.scales)
    return Scene(
        gaussians=gaussians, motion=motion, path=path, provenance=Provenance(generator="test")
    )


def assert_same_frames(scene: Scene, settings: RenderSettings | None = None) -> None:
    settings = settings or RenderSettings()
    frames = list(render_video(scene, scene.path, outputs=OUTPUTS, settings=settings))
    assert len(frames) == FRAMES
    for index, made in enumerate(frames):
        camera, time_s = scene.path.cameras[index], float(scene.path.times_s[index])
        alone = render(scene, camera, time_s, outputs=OUTPUTS, settings=settings, backend="raster")
        for name in OUTPUTS:
            # One state was rounded to float32 on the way: the cutoff may decide otherwise.
            off = (getattr(made, name) - getattr(alone, name)).abs() > 1e-4
            assert off.float().mean() < 2e-3, name
        assert made.dropped_by_parameter == alone.dropped_by_parameter


@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("moving", [torch.arange(0, COUNT, 7), torch.arange(COUNT)])
def test_key_frames(turning: bool, interpolation: str, moving: torch.Tensor) -> None:
    assert_same_frames(scene_with(keyed(moving, interpolation), turning))


def test_key_frames_half_a_turn_apart() -> None:
    motion = keyed(torch.arange(COUNT))
    rotations, half_turn = motion.rotations.clone(), torch.tensor([0.0, 0.6, 0.8, 0.0])
    for key in range(1, 4):
        before = quaternion.normalize(rotations[key - 1])
        rotations[key] = quaternion.multiply(before, half_turn.expand(COUNT, 4))
    assert_same_frames(scene_with(replace(motion, rotations=rotations)))


@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("bands", [1, 16])
def test_a_scene_that_stands_still(turning: bool, bands: int) -> None:
    assert_same_frames(scene_with(StaticMotion(), turning, bands))


def test_one_key_and_no_moving_gaussians() -> None:
    motion = keyed(torch.arange(9))
    first = {name: getattr(motion, name)[:1] for name in ("offsets", "rotations")}
    once = replace(
        motion,
        key_times_s=motion.key_times_s[:1],
        log_scale_offsets=motion.log_scale_offsets[:1],
        **first,
    )
    assert_same_frames(scene_with(once))
    assert_same_frames(scene_with(keyed(torch.zeros(0, dtype=torch.long))))


class Blinking:
    """A motion of another kind: it fades, colours and shrinks every second Gaussian."""

    time_range_s = (0.0, 1.0)
    moving_index = torch.arange(0, COUNT, 2)

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        index, factor = self.moving_index, 1 - 0.5 * time_s
        opacities, scales, sh = (
            getattr(gaussians, name).index_copy(0, index, factor * getattr(gaussians, name)[index])
            for name in ("opacities", "scales", "sh")
        )
        return replace(gaussians, opacities=opacities, scales=scales, sh=sh)

    def select(self, kept: torch.Tensor) -> "Blinking":
        raise NotImplementedError

    def to(self, target: object) -> "Blinking":
        return self


@pytest.mark.parametrize("bands", [1, 4])
def test_any_other_motion(bands: int) -> None:
    assert_same_frames(scene_with(Blinking(), bands=bands))


def test_lists_that_do_not_fit_are_not_kept() -> None:
    scene = scene_with(keyed(torch.arange(0, COUNT, 3)))
    wide = replace(scene.gaussians, scales=scene.gaussians.scales + 3.0)
    many = wide.select(torch.arange(COUNT).repeat(60))
    scene = replace(scene, gaussians=many)
    assert_same_frames(scene, RenderSettings(memory_bytes=1 << 20, tile_px=8))


@pytest.mark.parametrize("name", ["offsets", "rotations", "log_scale_offsets"])
@pytest.mark.parametrize("value", [float("nan"), 1e30])
def test_what_is_not_finite_in_a_motion_is_counted(name: str, value: float) -> None:
    motion = keyed(torch.arange(0, COUNT, 3))
    spoilt = getattr(motion, name).clone()
    spoilt[:, 4] = value
    scene = scene_with(replace(motion, **{name: spoilt}))
    frames = list(render_video(scene, scene.path))
    assert all(bool(torch.isfinite(frame.rgb).all()) for frame in frames)
    assert sum(frame.dropped_nonfinite for frame in frames) >= (0 if name == "rotations" else 1)


def test_frames_that_need_gradients_are_made_one_by_one() -> None:
    scene = scene_with(keyed(torch.arange(0, COUNT, 3)))
    scene.motion.offsets.requires_grad_()
    sum(frame.rgb.sum() for frame in render_video(scene, scene.path)).backward()
    assert bool(scene.motion.offsets.grad.any())
    with torch.no_grad():
        assert not next(iter(render_video(scene, scene.path))).rgb.requires_grad


def test_a_frame_that_was_given_away_does_not_change() -> None:
    scene = scene_with(keyed(torch.arange(COUNT)))
    frames = render_video(scene, scene.path, outputs=OUTPUTS)
    first = next(frames)
    kept = {name: getattr(first, name).clone() for name in OUTPUTS}
    list(frames)
    assert all(torch.equal(getattr(first, name), kept[name]) for name in OUTPUTS)


def sequence(scene: Scene, camera: Camera = CAMERA) -> tuple[Sequence, object]:
    plan = make_raster_settings(camera, RenderSettings(tile_px=8), colors=True, medians=False)
    view = make_view(plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px)
    return Sequence(scene, plan, depths=False), view


def test_rows_that_are_left_out_keep_their_time() -> None:
    scene = scene_with(keyed(torch.arange(COUNT)))
    drawn, view = sequence(scene)
    before = drawn.draw(view, 0.0).planes
    drawn.draw(view, 0.0)
    after = drawn.draw(view, 0.6, rows=(16, 32)).planes
    whole = sequence(scene)[0].draw(view, 0.6).planes
    assert torch.equal(after[:, :16], before[:, :16])
    assert torch.equal(after[:, 32:], before[:, 32:])
    torch.testing.assert_close(after[:, 16:32], whole[:, 16:32])
    # What was left out is caught up with, even when nothing moves any more.
    torch.testing.assert_close(drawn.draw(view, 0.6).planes, whole)


def test_rows_do_not_depend_on_the_memory() -> None:
    scene = scene_with(keyed(torch.arange(COUNT)))
    wide = replace(scene.gaussians, scales=scene.gaussians.scales + 3.0)
    many = replace(scene, gaussians=wide.select(torch.arange(COUNT).repeat(60)))
    images = []
    for memory_bytes in (1 << 20, 256 << 20):
        settings = RenderSettings(tile_px=8, memory_bytes=memory_bytes)
        plan = make_raster_settings(CAMERA, settings, colors=True, medians=False)
        view = make_view(plan.grid, CAMERA.world_from_camera, CAMERA.focal_px, CAMERA.center_px)
        drawn = Sequence(many, plan, depths=False)
        for time_s in (0.0, 0.0):
            drawn.draw(view, time_s)
        images.append(drawn.draw(view, 0.6, rows=(16, 32)).planes)
    assert torch.equal(*images)


def test_nothing_is_left_behind_where_lists_did_not_fit_for_a_while() -> None:
    motion = keyed(torch.arange(COUNT))
    grown = torch.tensor([-1.0, 2.0, 2.0, -1.0])[:, None, None].expand(4, COUNT, 3)
    scene = scene_with(replace(motion, log_scale_offsets=grown))
    plan = make_raster_settings(CAMERA, RenderSettings(tile_px=8), colors=True, medians=False)
    plan = replace(plan, pair_limit=1500)
    view = make_view(plan.grid, CAMERA.world_from_camera, CAMERA.focal_px, CAMERA.center_px)
    drawn = Sequence(scene, plan, depths=False)
    for time_s in (0.0, 0.0, 0.0, 0.5, 1.0):
        last = drawn.draw(view, time_s).planes
    assert torch.equal(last, Sequence(scene, plan, depths=False).draw(view, 1.0).planes)


def test_an_empty_scene() -> None:
    scene = scene_with(StaticMotion())
    empty = replace(scene, gaussians=scene.gaussians.select(torch.zeros(0, dtype=torch.long)))
    frames = list(render_video(empty, empty.path, outputs=OUTPUTS))
    assert len(frames) == FRAMES
    assert not any(frame.alpha.any() for frame in frames)


def test_gradients_are_a_matter_of_when_a_frame_is_made() -> None:
    scene = scene_with(keyed(torch.arange(0, COUNT, 3)))
    scene.motion.offsets.requires_grad_()
    with torch.no_grad():
        frames = render_video(scene, scene.path)
    assert next(frames).rgb.requires_grad


def test_keys_in_half_precision() -> None:
    motion = keyed(torch.arange(0, COUNT, 3))
    rough = replace(motion, log_scale_offsets=motion.log_scale_offsets.bfloat16())
    frames = list(render_video(scene_with(rough), scene_with(rough).path))
    exact = list(render_video(scene_with(motion), scene_with(motion).path))
    for got, want in zip(frames, exact, strict=True):
        torch.testing.assert_close(got.rgb, want.rgb, rtol=0, atol=0.1)


def test_a_zero_quaternion_is_turned_by_the_motion() -> None:
    scene = scene_with(keyed(torch.arange(COUNT)))
    flat = replace(
        scene.gaussians,
        quats=torch.zeros(COUNT, 4),
        scales=torch.tensor([0.2, 0.02, 0.02]).repeat(COUNT, 1),
    )
    assert_same_frames(replace(scene, gaussians=flat))
    upright = replace(flat, quats=quaternion.identity_like(flat.quats))
    zero, one = (
        next(iter(render_video(replace(scene, gaussians=g), scene.path))).rgb
        for g in (flat, upright)
    )
    assert torch.equal(zero, one)

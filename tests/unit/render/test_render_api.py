import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from oracles_render import random_gaussians, small_camera

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render import backends
from diff4splat.render.api import render, render_video
from diff4splat.render.settings import OUTPUTS, RenderOutput, RenderSettings
from diff4splat.scene import harmonics
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

CAMERA = pinhole(8.0, (6, 7))
COUNT = 10


def drifting(velocity: tuple[float, float, float]) -> KeyframeMotion:
    """All Gaussians move by ``velocity`` per second, from 0 to 1 s."""
    offsets = torch.zeros(2, COUNT, 3)
    offsets[1] = torch.tensor(velocity)
    return KeyframeMotion(
        key_times_s=torch.tensor([0.0, 1.0]),
        moving_index=torch.arange(COUNT),
        offsets=offsets,
        rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(2, COUNT, 4),
        log_scale_offsets=torch.zeros(2, COUNT, 3),
    )


def scene_with(motion: Motion, frames: int = 3) -> Scene:
    """Random Gaussians and a path that moves sideways."""
    poses = torch.eye(4).repeat(frames, 1, 1)
    poses[:, 0, 3] = 0.1 * torch.arange(frames)
    path = CameraPath(cameras=CAMERA.with_pose(poses), times_s=0.5 * torch.arange(frames))
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    return Scene(
        gaussians=gaussians, motion=motion, path=path, provenance=Provenance(generator="test")
    )


def test_only_what_is_asked_for_is_made() -> None:
    made = render(random_gaussians(COUNT), CAMERA, outputs=("alpha",))
    assert [name for name in OUTPUTS if getattr(made, name) is not None] == ["alpha"]


@pytest.mark.parametrize("name", OUTPUTS)
def test_an_image_is_the_same_alone_and_in_company(name: str) -> None:
    features = torch.rand(COUNT, 2, dtype=torch.float64)
    settings = RenderSettings(flow_camera=small_camera((6, 7)), features=features)
    gaussians = random_gaussians(COUNT)
    alone = render(gaussians, CAMERA, outputs=(name,), settings=settings)
    together = render(gaussians, CAMERA, outputs=OUTPUTS, settings=settings)
    torch.testing.assert_close(getattr(alone, name), getattr(together, name))
    assert getattr(alone, name).shape[:2] == (6, 7)


def test_a_scene_is_seen_at_its_time() -> None:
    scene = scene_with(drifting((0.4, 0.0, 0.0)))
    moved = replace(scene.gaussians, means=scene.gaussians.means + torch.tensor([0.2, 0.0, 0.0]))
    torch.testing.assert_close(render(scene, CAMERA, 0.5).rgb, render(moved, CAMERA).rgb)


@pytest.mark.parametrize("backend", ["reference", "raster"])
def test_a_scene_is_dilated_as_it_asks_unless_something_else_is_asked_for(backend: str) -> None:
    scene = replace(scene_with(StaticMotion()), dilation_px2=0.7)
    bare = scene.gaussians
    own, other = RenderSettings(dilation_px2=0.7), RenderSettings(dilation_px2=0.0)
    asked = render(bare, CAMERA, settings=own, backend=backend).rgb
    assert torch.equal(render(scene, CAMERA, backend=backend).rgb, asked)
    assert torch.equal(next(render_video(scene, scene.path, backend=backend)).rgb, asked)
    told = render(scene, CAMERA, settings=other, backend=backend).rgb
    assert torch.equal(told, render(bare, CAMERA, settings=other, backend=backend).rgb)
    assert not torch.equal(told, asked)


@pytest.mark.parametrize("bad", [-0.1, float("nan"), float("inf")])
def test_a_scene_asks_for_a_dilation_that_there_is(bad: float) -> None:
    with pytest.raises(ConfigError, match=r"Scene\.dilation_px2: expected a finite number"):
        replace(scene_with(StaticMotion()), dilation_px2=bad)


def test_the_camera_takes_the_dtype_of_the_gaussians() -> None:
    assert render(random_gaussians(COUNT), CAMERA).rgb.dtype == torch.float64


def test_autocast_does_not_reach_the_arithmetic() -> None:
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        inside = render(gaussians, CAMERA).rgb
    assert torch.equal(inside, render(gaussians, CAMERA).rgb)


def test_half_precision_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"expected float32 or float64, got torch\.float16"):
        render(random_gaussians(COUNT, dtype=torch.float16), CAMERA)


def test_mixed_precision_is_refused() -> None:
    gaussians = random_gaussians(COUNT)
    mixed = replace(gaussians, scales=gaussians.scales.float())
    with pytest.raises(
        ShapeError, match=r"expected one dtype and device, got torch\.float32 on cpu"
    ):
        render(mixed, CAMERA)


def test_a_batch_of_cameras_and_times_is_a_stack_of_images() -> None:
    scene = scene_with(drifting((0.4, 0.0, 0.0)))
    times_s = torch.tensor([0.0, 0.25, 1.0])
    made = render(scene, scene.path.cameras, times_s, outputs=("rgb", "depth"))
    for index, time_s in enumerate(times_s.tolist()):
        one = render(scene, scene.path.cameras[index], time_s, outputs=("rgb", "depth"))
        assert torch.equal(made.rgb[index], one.rgb)
        assert torch.equal(made.depth[index], one.depth)
    assert made.alpha is None


def test_one_camera_serves_all_times_and_one_time_all_cameras() -> None:
    scene = scene_with(drifting((0.4, 0.0, 0.0)))
    assert render(scene, CAMERA, torch.tensor([0.0, 0.5])).rgb.shape == (2, 6, 7, 3)
    assert render(scene, scene.path.cameras, 0.5).rgb.shape == (3, 6, 7, 3)


def test_what_is_left_out_counts_in_every_image() -> None:
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    gaussians.scales[2] = float("nan")
    made = render(gaussians, CAMERA.with_pose(torch.eye(4).expand(2, 4, 4)))
    assert made.dropped_by_parameter == {"scales": 2}
    assert made.dropped_nonfinite == 2


def test_other_numbers_of_times_and_axes_are_refused() -> None:
    batch = CAMERA.with_pose(torch.eye(4).expand(2, 4, 4))
    with pytest.raises(ShapeError, match="expected 1 or 2 times for the cameras, got 3"):
        render(random_gaussians(COUNT), batch, torch.zeros(3))
    grid = CAMERA.with_pose(torch.eye(4).expand(2, 2, 4, 4))
    with pytest.raises(ShapeError, match=r"at most one batch axis, got shape \(2, 2\)"):
        render(random_gaussians(COUNT), grid)
    with pytest.raises(ShapeError, match="expected one camera, got a batch"):
        settings = RenderSettings(flow_camera=batch)
        render(random_gaussians(COUNT), CAMERA, outputs=("flow",), settings=settings)
    with pytest.raises(ShapeError, match="at least one of each, got an empty batch"):
        render(random_gaussians(COUNT), CAMERA.with_pose(torch.eye(4).expand(0, 4, 4)))


def test_features_are_blended_like_colours() -> None:
    gaussians = random_gaussians(COUNT, bands=1)
    settings = RenderSettings(features=harmonics.color_from_dc(gaussians.sh[:, 0]).clamp_min(0))
    made = render(gaussians, CAMERA, outputs=("rgb", "features"), settings=settings)
    torch.testing.assert_close(made.features, made.rgb)


def test_features_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"features expected .*features, got None"):
        render(random_gaussians(COUNT), CAMERA, outputs=("features",))
    settings = RenderSettings(features=torch.zeros(3, 2))
    with pytest.raises(ShapeError, match=r"expected \(10, channels\), got \(3, 2\)"):
        render(random_gaussians(COUNT), CAMERA, outputs=("features",), settings=settings)


def test_features_that_are_not_finite_are_refused() -> None:
    features = torch.zeros(COUNT, 2)
    features[3, 1] = float("nan")
    with pytest.raises(InputError, match=r"settings\.features: expected finite numbers"):
        settings = RenderSettings(features=features)
        render(random_gaussians(COUNT), CAMERA, outputs=("features",), settings=settings)


def test_depth_at_the_near_plane_is_that_of_what_is_drawn() -> None:
    camera = small_camera((6, 7), torch.float32)
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    pose = camera.world_from_camera
    aside = torch.linspace(50.0, 150.0, COUNT)
    local = torch.stack([aside, torch.zeros(COUNT), torch.full((COUNT,), 0.0100002)], -1)
    near = replace(
        gaussians,
        means=local @ pose[:3, :3].mT + pose[:3, 3],
        scales=torch.full((COUNT, 3), 60.0),
    )
    made = render(near, camera, outputs=("depth", "alpha"))
    assert bool((made.alpha > 0).any())
    assert float(made.depth.max()) < 0.02


@pytest.mark.parametrize("backend", ["raster", "reference"])
def test_a_background_can_be_learnt(backend: str) -> None:
    background = torch.tensor([0.1, 0.2, 0.3], requires_grad=True)
    settings = RenderSettings(background=background)
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    made = render(gaussians, CAMERA, outputs=("rgb", "alpha"), settings=settings, backend=backend)
    made.rgb.sum().backward()
    expected = (1 - made.alpha).sum().expand(3)
    torch.testing.assert_close(background.grad, expected)
    fixed = render(gaussians, CAMERA, settings=RenderSettings(background=(0.1, 0.2, 0.3)))
    torch.testing.assert_close(made.rgb, fixed.rgb)


def test_a_background_that_is_no_colour_is_refused() -> None:
    with pytest.raises(ConfigError, match="background: expected three finite numbers"):
        RenderSettings(background=torch.tensor([0.0, float("nan"), 0.0]))


@pytest.mark.parametrize("focal", [0.0, -1.0, float("nan")])
def test_unusable_cameras_are_refused(focal: float) -> None:
    with pytest.raises(InputError, match="expected finite pose and intrinsics and focal lengths"):
        render(random_gaussians(COUNT), replace(CAMERA, focal_px=torch.tensor([8.0, focal])))


def test_flow_needs_somewhere_to_go() -> None:
    with pytest.raises(
        ConfigError, match=r"flow expected settings\.flow_time_s or settings\.flow_"
    ):
        render(random_gaussians(COUNT), CAMERA, outputs=("flow",))


def test_a_video_is_its_frames_one_at_a_time() -> None:
    scene, done = scene_with(drifting((0.4, 0.0, 0.0))), []
    frames = render_video(
        scene, scene.path, outputs=("rgb", "depth"), advance=lambda: done.append(1)
    )
    assert done == []
    for index, frame in enumerate(frames):
        assert len(done) == index + 1
        alone = render(scene, scene.path.cameras[index], 0.5 * index, outputs=("rgb", "depth"))
        torch.testing.assert_close(frame.rgb, alone.rgb)
        torch.testing.assert_close(frame.depth, alone.depth)
    assert len(done) == 3


def test_flow_in_a_video_runs_to_the_next_frame() -> None:
    scene = scene_with(drifting((0.4, 0.0, 0.1)))
    first, second, last = render_video(scene, scene.path, outputs=("flow",))
    settings = RenderSettings(flow_camera=scene.path.cameras[2], flow_time_s=1.0)
    alone = render(scene, scene.path.cameras[1], 0.5, outputs=("flow",), settings=settings)
    assert torch.equal(second.flow, alone.flow)
    assert float(first.flow.abs().max()) > 0.1
    assert not last.flow.any()


def test_a_scene_that_stands_still_has_no_state_per_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_with(StaticMotion())
    monkeypatch.delattr(StaticMotion, "state_at")
    assert len(list(render_video(scene, scene.path))) == 3


def test_a_video_refuses_before_the_first_frame() -> None:
    scene = scene_with(StaticMotion())
    with pytest.raises(ConfigError, match="expected names among"):
        render_video(scene, scene.path, outputs=("colour",))


def test_unknown_back_ends_are_answered_with_the_known() -> None:
    with pytest.raises(ConfigError, match=r"backend: expected auto, .*reference, got 'magic'"):
        render(random_gaussians(COUNT), CAMERA, backend="magic")


@pytest.fixture
def picky(monkeypatch: pytest.MonkeyPatch) -> RenderOutput:
    """A back end before all others that only does float32; what it answers."""
    answer = RenderOutput(dropped_nonfinite=7)

    def unsupported_reason(job: object) -> str | None:
        dtype = job.gaussians.means.dtype
        return None if dtype == torch.float32 else f"expected float32, got {dtype}"

    monkeypatch.setitem(
        sys.modules,
        "picky",
        SimpleNamespace(unsupported_reason=unsupported_reason, render=lambda job: answer),
    )
    monkeypatch.setattr(backends, "BACKENDS", {"picky": "picky", **backends.BACKENDS})
    return answer


def test_auto_takes_the_first_that_does_not_refuse(picky: RenderOutput) -> None:
    assert render(random_gaussians(COUNT, dtype=torch.float32), CAMERA) is picky
    assert render(random_gaussians(COUNT), CAMERA).rgb is not None
    assert (
        render(random_gaussians(COUNT, dtype=torch.float32), CAMERA, backend="reference")
        is not picky
    )


@pytest.mark.usefixtures("picky")
def test_a_back_end_that_refuses_says_why() -> None:
    with pytest.raises(
        ConfigError, match=r"backend 'picky': expected float32, got torch\.float64; use"
    ):
        render(random_gaussians(COUNT), CAMERA, backend="picky")


@pytest.mark.parametrize("field", ["focal_px", "center_px", "world_from_camera"])
def test_cameras_beyond_what_float32_multiplies_are_refused(field: str) -> None:
    value = getattr(CAMERA, field).clone()
    value.view(-1)[-2 if field == "world_from_camera" else 0] = 2e31
    with pytest.raises(InputError, match="all below 1e"):
        render(random_gaussians(COUNT), replace(CAMERA, **{field: value}))


def test_the_reference_refuses_what_takes_minutes() -> None:
    wall = random_gaussians(400)
    large, opaque = torch.full_like(wall.scales, 1e3), torch.ones_like(wall.opacities)
    wall = replace(wall, scales=large, opacities=opaque)
    with pytest.raises(ConfigError, match="pairs of a Gaussian and a pixel"):
        render(wall, pinhole(4e3, (4000, 4000)), backend="reference")

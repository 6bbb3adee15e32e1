"""Value and gradient stay finite, and the image stays right, where numbers are extreme."""

from dataclasses import fields, replace

import pytest
import torch
from oracles_render import random_gaussians, small_camera
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from diff4splat.geometry.camera import pinhole
from diff4splat.render import backends
from diff4splat.render.api import render
from diff4splat.render.raster.raster_settings import DEFAULT_LIGHT_CUTOFF
from diff4splat.render.settings import OUTPUTS, RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = pinhole(16.0, (12, 14))
FEATURES = torch.linspace(-1, 1, 40).view(20, 2)
COUNT = 20


@pytest.fixture(params=["reference", "raster"], autouse=True)
def _back_end(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every test runs on every back end of this machine; the reference does what others refuse."""
    table = {name: backends.BACKENDS[name] for name in (request.param, "reference")}
    monkeypatch.setattr(backends, "BACKENDS", table)


def cloud(**changes: object) -> Gaussians:
    """Float32 Gaussians with some parameters replaced by one value."""
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    values = {
        name: torch.as_tensor(value, dtype=torch.float32).expand(getattr(gaussians, name).shape)
        for name, value in changes.items()
    }
    return replace(gaussians, **values)


SCENES = {
    "tiny": cloud(scales=1e-6),
    "vanishing": cloud(scales=0.0),
    "huge": cloud(scales=1e3),
    "astronomic": cloud(scales=1e15),
    "needles": cloud(scales=[1e3, 1e-6, 1e-6]),
    "discs": cloud(scales=[1.0, 1.0, 0.0]),
    "clear": cloud(opacities=0.0),
    "opaque": cloud(opacities=1.0),
    "beyond opaque": cloud(opacities=5.0),
    "zero quaternions": cloud(quats=0.0),
    "tiny quaternions": cloud(quats=1e-30),
    "coincident": cloud(means=[0.1, 0.0, 2.0]),
    "coplanar": cloud(scales=[0.1, 0.1, 1e-6], quats=[1.0, 0.0, 0.0, 0.0]),
    "edge on": cloud(scales=[0.1, 0.1, 0.0], quats=[0.5**0.5, 0.5**0.5, 0.0, 0.0]),
    "on the camera plane": cloud(means=[1.0, 0.0, 0.0]),
    "in the camera": cloud(means=0.0),
    "just in front": cloud(means=[1.0, 0.0, 0.0101], scales=1.0),
    "behind": cloud(means=[0.0, 0.0, -2.0]),
    "very far": cloud(means=[0.0, 0.0, 1e12], scales=1e11),
    "bright": cloud(sh=1e10),
    "nobody": random_gaussians(COUNT, dtype=torch.float32).select(torch.zeros(0, dtype=torch.long)),
}
SETTINGS = {
    "plain": RenderSettings(flow_camera=CAMERA),
    "antialias": RenderSettings(flow_camera=CAMERA, antialias=True),
    "no dilation": RenderSettings(flow_camera=CAMERA, dilation_px2=0.0),
    "antialias without dilation": RenderSettings(
        flow_camera=CAMERA, dilation_px2=0.0, antialias=True
    ),
}


def with_gradients(gaussians: Gaussians) -> Gaussians:
    """A copy whose parameters collect gradients."""
    return replace(
        gaussians,
        **{f.name: getattr(gaussians, f.name).clone().requires_grad_() for f in fields(gaussians)},
    )


def assert_finite(gaussians: Gaussians, camera=CAMERA, settings=SETTINGS["plain"]) -> None:
    """Every image and every gradient, those of the camera included."""
    gaussians = with_gradients(gaussians)
    tensors = {
        name: getattr(camera, name).clone().requires_grad_()
        for name in ("world_from_camera", "focal_px", "center_px")
    }
    settings = replace(settings, features=FEATURES[: len(gaussians)])
    made = render(gaussians, replace(camera, **tensors), outputs=OUTPUTS, settings=settings)
    for name in OUTPUTS:
        assert bool(torch.isfinite(getattr(made, name)).all()), name
    assert bool(((made.alpha >= 0) & (made.alpha <= 1)).all())
    total = sum(getattr(made, name).mean() for name in OUTPUTS)
    if not total.requires_grad:
        return
    total.backward()
    leaves = {f.name: getattr(gaussians, f.name) for f in fields(gaussians)} | tensors
    for name, leaf in leaves.items():
        assert leaf.grad is None or bool(torch.isfinite(leaf.grad).all()), name


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_value_and_gradient_are_finite(scene: Gaussians) -> None:
    for settings in SETTINGS.values():
        assert_finite(scene, settings=settings)


@pytest.mark.parametrize("focal_px", [1e-6, 1e7])
def test_extreme_lenses(focal_px: float) -> None:
    assert_finite(cloud(), replace(CAMERA, focal_px=torch.tensor([focal_px, focal_px])))


def test_one_pixel() -> None:
    assert_finite(cloud(), pinhole(1.0, (1, 1)))


def test_an_empty_scene_shows_the_background() -> None:
    settings = replace(SETTINGS["plain"], background=(0.1, 0.2, 0.3), features=FEATURES[:0])
    made = render(SCENES["nobody"], CAMERA, outputs=OUTPUTS, settings=settings)
    assert torch.equal(made.rgb, torch.tensor([0.1, 0.2, 0.3]).expand(12, 14, 3))
    assert made.features.shape == (12, 14, 2)
    for name in ("alpha", "depth", "median_depth", "flow", "features"):
        assert not getattr(made, name).any()


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1e30])
def test_what_is_not_finite_is_counted_and_left_out(name: str, value: float) -> None:
    gaussians = cloud()
    spoilt = {name: getattr(gaussians, name).clone()}
    spoilt[name][3] = spoilt[name][7] = value
    broken = with_gradients(replace(gaussians, **spoilt))
    kept = torch.ones(COUNT, dtype=torch.bool)
    kept[[3, 7]] = False
    made = render(broken, CAMERA)
    made.rgb.sum().backward()
    assert made.dropped_nonfinite == 2
    assert torch.equal(made.rgb, render(gaussians.select(kept), CAMERA).rgb)
    for field in fields(broken):
        assert bool(torch.isfinite(getattr(broken, field.name).grad).all()), field.name


def test_nothing_is_counted_in_a_clean_scene() -> None:
    assert render(cloud(), CAMERA).dropped_nonfinite == 0


def test_far_from_the_origin_the_image_is_the_same() -> None:
    gaussians, camera = cloud(), small_camera(dtype=torch.float32)
    # 1e6 + k / 16 is exact in float32, so nothing is lost before the renderer sees it.
    gaussians = replace(gaussians, means=(gaussians.means * 16).round() / 16)
    near, far = camera.world_from_camera.clone(), camera.world_from_camera.clone()
    near[:3, 3], far[:3, 3] = 0.0, 1e6
    away = replace(gaussians, means=gaussians.means + 1e6)
    there = render(away, camera.with_pose(far)).rgb
    assert torch.equal(there, render(gaussians, camera.with_pose(near)).rgb)


@pytest.mark.parametrize("antialias", [False, True])
def test_a_gaussian_of_any_size_is_seen_everywhere(antialias: bool) -> None:
    wide = cloud(scales=1e15, opacities=0.5).select(torch.tensor([0]))
    settings = RenderSettings(antialias=antialias)
    alpha = render(wide, CAMERA, outputs=("alpha",), settings=settings).alpha
    torch.testing.assert_close(alpha, torch.full_like(alpha, 0.5))


@pytest.mark.parametrize("scales", [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
def test_what_has_no_area_is_not_seen_even_on_a_pixel_centre(scales: list[float]) -> None:
    point = cloud(means=[0.0, 0.0, 2.0], scales=scales, quats=[1.0, 0.0, 0.0, 0.0])
    camera, settings = pinhole(16.0, (13, 13)), SETTINGS["no dilation"]
    assert_finite(point, camera, settings)
    assert not render(point, camera, outputs=("alpha",), settings=settings).alpha.any()


def test_a_needle_is_as_right_in_float32_as_in_float64() -> None:
    needle = replace(
        cloud(scales=[30.0, 0.02, 0.02]).select(torch.tensor([0])),
        means=torch.tensor([[0.0, 0.0, 2.0]]),
        quats=torch.tensor([[0.9238795, 0.0, 0.0, 0.3826834]]),
        opacities=torch.tensor([0.9]),
    )
    camera = pinhole(200.0, (40, 40))
    single = render(needle, camera).rgb.double()
    torch.testing.assert_close(
        single, render(needle.to(torch.float64), camera).rgb, rtol=0, atol=2e-4
    )


class LargestTensor(TorchDispatchMode):
    """Watches every operation for the largest tensor it makes."""

    largest_bytes = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        made = func(*args, **(kwargs or {}))
        for tensor in tree_leaves(made):
            if isinstance(tensor, torch.Tensor):
                self.largest_bytes = max(self.largest_bytes, tensor.nbytes)
        return made


def test_many_coincident_gaussians_fit_in_little_memory() -> None:
    count, settings = 10_000, RenderSettings(memory_bytes=1 << 20)
    one = cloud(means=[0.0, 0.0, 2.0], scales=0.02, opacities=0.01).select(torch.tensor([0]))
    stack = with_gradients(one.select(torch.zeros(count, dtype=torch.long)))
    with LargestTensor() as watch:
        alpha = render(stack, pinhole(1.0, (1, 1)), outputs=("alpha",), settings=settings).alpha
        alpha.sum().backward()
    # One value per Gaussian and pixel of the tile would take 2.5 MB.
    assert watch.largest_bytes <= settings.memory_bytes
    assert float(alpha.detach()) == pytest.approx(1.0, abs=2 * DEFAULT_LIGHT_CUTOFF)
    assert bool(torch.isfinite(stack.opacities.grad).all())


def test_gaussians_over_the_whole_image_fit_in_little_memory() -> None:
    settings, wide = RenderSettings(memory_bytes=1 << 20), with_gradients(cloud(scales=100.0))
    with LargestTensor() as watch:
        rgb = render(wide, pinhole(64.0, (128, 128)), settings=settings).rgb
        rgb.sum().backward()
    # One value per Gaussian and pixel would take 1.3 MB, a pair of tiles and Gaussians 0.2 MB.
    assert watch.largest_bytes <= settings.memory_bytes

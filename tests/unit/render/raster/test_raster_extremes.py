"""Finite images and gradients where numbers, counts and sizes are extreme."""

from dataclasses import replace

import pytest
import torch
from oracles_raster import LENS, PARAMETERS, cloud, leaves, lens_leaves, stack
from oracles_render import random_gaussians

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.render.api import render
from diff4splat.render.settings import OUTPUTS, RenderOutput, RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = pinhole(16.0, (12, 14))
COUNT = 20
LARGEST = 1.8e19


def some(**changes: object) -> Gaussians:
    """Float32 Gaussians with some parameters replaced by one value."""
    gaussians = random_gaussians(COUNT, dtype=torch.float32)
    values = {
        name: torch.as_tensor(value, dtype=torch.float32).expand(getattr(gaussians, name).shape)
        for name, value in changes.items()
    }
    return replace(gaussians, **values)


def assert_finite(
    gaussians: Gaussians,
    camera: Camera = CAMERA,
    names: tuple[str, ...] = OUTPUTS,
    **changes: object,
) -> RenderOutput:
    """Every image and every gradient, those of features, camera and background included."""
    own, lens = leaves(gaussians), lens_leaves(camera, torch.float32)
    features = torch.linspace(-1, 1, 2 * len(gaussians)).view(-1, 2).requires_grad_()
    background = torch.full((3,), 0.5, requires_grad=True)
    own_settings = RenderSettings(
        features=features, flow_camera=lens, background=background, **changes
    )
    made = render(own, lens, outputs=names, settings=own_settings, backend="raster")
    for name in names:
        assert bool(torch.isfinite(getattr(made, name)).all()), name
    sum(getattr(made, name).mean() for name in names).backward()
    named = {name: getattr(own, name) for name in PARAMETERS}
    named |= {name: getattr(lens, name) for name in LENS}
    for name, leaf in (named | {"features": features, "background": background}).items():
        assert leaf.grad is None or bool(torch.isfinite(leaf.grad).all()), name
    if made.alpha is not None:
        assert bool(((made.alpha >= 0) & (made.alpha <= 1)).all())
    return made


WALLS = some(scales=100.0, opacities=5.0)
CASES = {
    "no light is too little": (WALLS, {"light_cutoff": 1e-30}),
    "half the light is too little": (some(), {"light_cutoff": 0.5}),
    "nearly all is too little": (WALLS, {"light_cutoff": 0.999999}),
    "the faintest count": (some(), {"alpha_cutoff": 1e-12}),
    "fainter than float32": (some(), {"alpha_cutoff": 1e-40}),
    "fainter than float64": (some(), {"alpha_cutoff": 1e-300}),
    "only the opaque count": (some(opacities=1.0), {"alpha_cutoff": 0.99}),
    "all but opaque": (WALLS, {"alpha_max": 0.9999999, "light_cutoff": 1e-30}),
    "opaque once rounded": (some(opacities=2.0), {"alpha_max": 1 - 1e-9}),
    "clear": (some(opacities=0.0), {}),
    "less than clear": (some(opacities=-1.0), {}),
    "denormal opacity": (some(opacities=1e-40), {}),
    "opaque": (some(opacities=1.0), {}),
    "beyond opaque": (some(opacities=3.0), {}),
    "far beyond opaque": (some(opacities=LARGEST), {}),
    "negative scales": (some(scales=-0.1), {}),
    "largest scales": (some(scales=LARGEST), {"antialias": True}),
    "tiny quaternions": (some(quats=1e-38), {}),
    "large quaternions": (some(quats=LARGEST), {}),
    "bright": (some(sh=LARGEST), {}),
    "dark": (some(sh=-LARGEST), {}),
    "wide dilation": (some(), {"dilation_px2": 1e30, "antialias": True}),
    "no dilation to speak of": (some(), {"dilation_px2": 1e-300, "antialias": True}),
    "just in front": (some(means=[1e-22, 0, 1e-20], scales=1e-21), {"near_depth": 1e-30}),
}


@pytest.mark.parametrize(("gaussians", "changes"), CASES.values(), ids=CASES)
def test_value_and_gradient_are_finite(gaussians: Gaussians, changes: dict) -> None:
    assert_finite(gaussians, **changes)


@pytest.mark.parametrize("center", [1e9, -1e9, 1e30])
def test_the_principal_point_may_be_anywhere(center: float) -> None:
    away = replace(CAMERA, center_px=torch.tensor([center, -center]))
    made = assert_finite(some(scales=0.1), away, ("rgb", "alpha", "depth"))
    assert not made.alpha.any()


@pytest.mark.parametrize("focal", [1e-30, 1e15, 1e25])
def test_lenses_without_reason(focal: float) -> None:
    assert_finite(some(), replace(CAMERA, focal_px=torch.tensor([focal, focal])), ("rgb", "alpha"))


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e25])
def test_gaussians_left_out_have_no_gradient(name: str, value: float) -> None:
    gaussians = some()
    spoilt = getattr(gaussians, name).clone()
    spoilt[::3] = value
    own = leaves(replace(gaussians, **{name: spoilt}))
    features = torch.randn(COUNT, 2, requires_grad=True)
    made = render(
        own, CAMERA, outputs=("rgb", "depth", "features"),
        settings=RenderSettings(features=features), backend="raster",
    )  # fmt: skip
    assert made.dropped_by_parameter == {name: 7}
    (made.rgb.sum() + made.depth.sum() + made.features.sum()).backward()
    for leaf in (features, *(getattr(own, other) for other in PARAMETERS)):
        assert bool(torch.isfinite(leaf.grad).all())
        assert not leaf.grad[::3].any()


def test_a_pile_of_opaque_gaussians_keeps_some_light() -> None:
    camera = pinhole(64.0, (8, 16))
    pile = stack(10_000, 1.0, place=(-3.5 / 64, 0.5 / 64))
    for changes in (
        {},
        {"light_cutoff": 1e-30},
        {"light_cutoff": 1e-30, "alpha_max": 0.9999999},
    ):
        made = assert_finite(pile, camera, **changes)
        assert float(made.alpha[4, 4].detach()) == pytest.approx(1.0, abs=1e-4)
        assert not made.alpha[:, 8:].any()


def test_a_deep_pile_of_faint_gaussians_keeps_its_gradient() -> None:
    # Light is found again by dividing; ten thousand roundings must not add up.
    camera, own = pinhole(1.0, (1, 1)), {"light_cutoff": 1e-30, "alpha_cutoff": 1e-6}
    grads = {}
    for backend, dtype in (("raster", torch.float32), ("reference", torch.float64)):
        pile = leaves(stack(10_000, 0.002).to(dtype))
        made = render(
            pile, camera, outputs=("depth", "alpha"), settings=RenderSettings(**own),
            backend=backend,
        )  # fmt: skip
        made.alpha.sum().backward()
        grads[backend] = pile.opacities.grad.double()
    relative = grads["raster"] / grads["reference"] - 1
    assert float(relative.abs().max()) < 2e-3


def test_one_pixel() -> None:
    made = assert_finite(some(), pinhole(1.0, (1, 1)))
    assert made.rgb.shape == (1, 1, 3)


@pytest.mark.parametrize("size_px", [(1, 300), (300, 1), (7, 129)])
def test_narrow_images(size_px: tuple[int, int]) -> None:
    assert assert_finite(cloud(50), pinhole(100.0, size_px)).alpha.shape == size_px


def test_a_hundred_thousand_behind_the_camera() -> None:
    crowd = random_gaussians(100_000, dtype=torch.float32, bands=1)
    behind = replace(crowd, means=-crowd.means)
    assert not assert_finite(behind).alpha.any()


def test_a_hundred_thousand_in_one_pixel() -> None:
    made = assert_finite(stack(100_000, 0.5), pinhole(1.0, (1, 1)))
    assert float(made.alpha.detach()) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.slow
def test_a_million_in_one_pixel() -> None:
    changes = {"alpha_cutoff": 1e-6, "light_cutoff": 1e-30}
    made = assert_finite(stack(1_000_000, 1e-4), pinhole(1.0, (1, 1)), ("rgb", "alpha"), **changes)
    assert float(made.alpha.detach()) == pytest.approx(1.0, abs=1e-6)


def test_one_gaussian_over_a_whole_image() -> None:
    one = some(means=[0.0, 0.0, 2.0], scales=50.0, opacities=0.9).select(torch.tensor([0]))
    made = assert_finite(one, pinhole(1500.0, (1080, 2048)), ("rgb", "alpha"))
    want = torch.full_like(made.alpha, 0.9)
    torch.testing.assert_close(made.alpha, want, rtol=0, atol=1e-3)


@pytest.mark.slow
def test_an_image_of_eight_thousand_columns() -> None:
    gaussians = cloud(50, spread_px=2.0)
    made = assert_finite(gaussians, pinhole(3000.0, (4320, 7680)), ("alpha",))
    small = render(gaussians, pinhole(3000 / 16, (270, 480)), outputs=("alpha",)).alpha
    shrunk = torch.nn.functional.avg_pool2d(made.alpha[None].detach(), 16)[0]
    # Dilation is a matter of pixels, so the two differ around the edges.
    assert float((shrunk - small).abs().mean()) < 0.01

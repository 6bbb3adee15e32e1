"""What goes into gsplat and what comes out, with a stand-in of gsplat's own formulas on a CPU."""

from collections.abc import Iterator
from dataclasses import replace

import fake_gsplat
import oracles_gsplat as oracles
import pytest
import torch
from oracles_gsplat import EXTREMES, MADE, View, aligned_view, both, everything, random_view

from diff4splat.render import backends
from diff4splat.render.api import render
from diff4splat.render.gsplat import backend, limits
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

SMALL = random_view(edge_px=24, count=60)
CLOSE_DECIBELS = 110.0
"""Where no pixel is left early, both do float32 arithmetic on the same formulas."""


@pytest.fixture(autouse=True)
def calls(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[dict]]:
    """The stand-in is installed and takes CPU tensors; what it is called with."""
    table = {"gsplat": "diff4splat.render.gsplat.backend"}
    table["reference"] = backends.BACKENDS["reference"]
    monkeypatch.setattr(backends, "BACKENDS", table)
    monkeypatch.setattr(limits, "DEVICE_TYPE", "cpu")
    backend.loading_problem.cache_clear()
    yield fake_gsplat.install(monkeypatch)
    backend.loading_problem.cache_clear()


def spoilt(gaussians: Gaussians, name: str, value: float) -> Gaussians:
    """Two Gaussians get ``value`` in one of their parameters."""
    changed = getattr(gaussians, name).clone()
    changed[3] = changed[7] = value
    return replace(gaussians, **{name: changed})


@pytest.mark.parametrize("bands", [1, 4, 9, 16])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"antialias": True},
        {"dilation_px2": 0.0},
        {"dilation_px2": 1.5, "near_depth": 2.0},
        {"background": torch.tensor([0.9, 0.0, 0.4])},
    ],
    ids=str,
)
def test_images_are_those_of_the_reference(bands: int, changes: dict) -> None:
    view = replace(SMALL[0], sh=SMALL[0].sh[:, :bands]), SMALL[1]
    got, want = both(view, replace(everything(view), **changes))
    oracles.assert_same_images(got, want, CLOSE_DECIBELS)
    assert float(want.alpha.max()) > 0.5


def test_one_gaussian_per_pixel() -> None:
    view = aligned_view(24)
    oracles.assert_same_images(*both(view, everything(view)), CLOSE_DECIBELS)


@pytest.mark.parametrize("antialias", [False, True])
@pytest.mark.parametrize("outputs", [("rgb",), ("rgb", "depth"), MADE], ids=str)
def test_gradients_are_those_of_the_reference(antialias: bool, outputs: tuple[str, ...]) -> None:
    settings = replace(everything(SMALL), antialias=antialias)
    got, want = (
        oracles.gradients(SMALL, name, settings, outputs) for name in ("gsplat", "reference")
    )
    assert all(float(gradient.norm()) > 0 for gradient in want.values())
    oracles.assert_same_gradients(got, want, 1e-3)


@pytest.mark.parametrize("name", ["background", "features"])
def test_settings_get_gradients_too(name: str) -> None:
    found = []
    for chosen in ("gsplat", "reference"):
        values = {"background": torch.tensor([0.2, 0.5, 0.8]), "features": SMALL[0].means.clone()}
        leaf = values[name].requires_grad_()
        settings = replace(everything(SMALL), **{name: leaf})
        made = render(*SMALL, outputs=("rgb", "features"), settings=settings, backend=chosen)
        (made.rgb.square().sum() + made.features.square().sum()).backward()
        found.append({name: leaf.grad})
    oracles.assert_same_gradients(*found, 1e-4)


@pytest.mark.parametrize(
    ("outputs", "mode", "channels", "degree"),
    [
        (("rgb",), "RGB", (16, 3), 3),
        (("rgb", "alpha"), "RGB", (16, 3), 3),
        (("rgb", "depth"), "RGB+D", (16, 3), 3),
        (("depth",), "D", (3,), None),
        (("alpha",), "D", (3,), None),
        (("flow",), "RGB", (3,), None),
        (("features", "depth"), "RGB", (5,), None),
        (("rgb", "features"), "RGB", (6,), None),
        (MADE, "RGB", (11,), None),
    ],
    ids=str,
)
def test_one_pass_makes_what_is_asked_for_and_no_more(
    calls: list[dict], outputs: tuple, mode: str, channels: tuple, degree: int | None
) -> None:
    got, want = both(SMALL, everything(SMALL), outputs)
    assert len(calls) == 1
    assert calls[0]["render_mode"] == mode
    assert calls[0]["colors"].shape == (60, *channels)
    assert calls[0]["sh_degree"] == degree
    for name in MADE:
        assert (getattr(got, name) is None) == (name not in outputs)
        if name in outputs:
            close = oracles.decibels(getattr(got, name), getattr(want, name))
            assert close >= CLOSE_DECIBELS, name


def test_the_camera_is_handed_over_in_gsplats_conventions(calls: list[dict]) -> None:
    gaussians, camera = SMALL
    settings = replace(everything(SMALL), dilation_px2=0.7, near_depth=0.5)
    render(gaussians, camera, outputs=("rgb", "features"), settings=settings, backend="gsplat")
    (call,) = calls
    view, expected = call["viewmats"][0], camera.camera_from_world
    torch.testing.assert_close(view[:3, :3], expected[:3, :3])
    assert view[3].tolist() == [0.0, 0.0, 0.0, 1.0]
    local = call["means"] @ view[:3, :3].mT + view[:3, 3]
    torch.testing.assert_close(local, gaussians.means @ expected[:3, :3].mT + expected[:3, 3])
    (f_x, f_y), (c_x, c_y) = camera.focal_px.tolist(), camera.center_px.tolist()
    assert call["Ks"].tolist() == [[[f_x, 0.0, c_x], [0.0, f_y, c_y], [0.0, 0.0, 1.0]]]
    assert (call["height"], call["width"]) == camera.size_px
    assert (call["eps2d"], call["radius_clip"]) == (0.7, 0.0)
    assert (call["rasterize_mode"], call["packed"]) == ("classic", False)
    torch.testing.assert_close(call["quats"], torch.nn.functional.normalize(gaussians.quats))


def test_antialias_is_asked_of_gsplat(calls: list[dict]) -> None:
    render(*SMALL, settings=RenderSettings(antialias=True), backend="gsplat")
    assert calls[0]["rasterize_mode"] == "antialiased"


@pytest.mark.parametrize("near_depth", [0.01, 0.5, 2.0])
def test_what_lies_on_the_near_plane_is_not_drawn(near_depth: float) -> None:
    gaussians, camera = oracles.extreme_view(means=[0.0, 0.0, near_depth], scales=0.1)
    settings = RenderSettings(near_depth=near_depth)
    made = render(gaussians, camera, outputs=("alpha",), settings=settings, backend="gsplat")
    assert not made.alpha.any()
    beyond = replace(gaussians, means=gaussians.means * (1 + 2**-22))
    made = render(beyond, camera, outputs=("alpha",), settings=settings, backend="gsplat")
    assert bool(made.alpha.any())


def test_far_from_the_origin_the_image_is_the_same() -> None:
    gaussians, camera = SMALL
    # 1e6 + k / 16 is exact in float32, so nothing is lost before the renderer sees it.
    gaussians = replace(gaussians, means=(gaussians.means * 16).round() / 16)
    near, far = camera.world_from_camera.clone(), camera.world_from_camera.clone()
    near[:3, 3], far[:3, 3] = 0.0, 1e6
    away = replace(gaussians, means=gaussians.means + 1e6)
    there = render(away, camera.with_pose(far), backend="gsplat").rgb
    here = render(gaussians, camera.with_pose(near), backend="gsplat").rgb
    assert torch.equal(there, here)


@pytest.mark.parametrize("view", EXTREMES.values(), ids=EXTREMES)
def test_extremes_agree_and_have_finite_gradients(view: View) -> None:
    settings = everything(view)
    oracles.assert_same_images(*both(view, settings))
    for outputs in (MADE, ("rgb",)):
        found = oracles.gradients(view, "gsplat", settings, outputs)
        for name, gradient in found.items():
            assert bool(torch.isfinite(gradient).all()), (name, outputs)


def test_a_pixel_left_early_misses_no_more_than_the_light_left_over() -> None:
    view = aligned_view(40, opacity=0.999)
    got, want = both(view, everything(view))
    early = oracles.left_early(want)
    difference = (got.rgb - want.rgb).abs().amax(-1)
    assert 0.5 < float(early.float().mean()) < 1
    assert oracles.decibels(got.rgb[~early], want.rgb[~early]) >= CLOSE_DECIBELS
    assert bool((difference <= 1 - got.alpha + 1e-5).all())
    assert 0.01 < float(difference.max()) < 1e-4 / (1 - 0.999)


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1e30])
def test_what_is_not_finite_is_counted_and_left_out(name: str, value: float) -> None:
    view = spoilt(SMALL[0], name, value), SMALL[1]
    settings = everything(SMALL)
    got, want = both(view, settings)
    assert got.dropped_nonfinite == 2
    oracles.assert_same_images(got, want, CLOSE_DECIBELS)
    for parameter, gradient in oracles.gradients(view, "gsplat", settings).items():
        assert bool(torch.isfinite(gradient).all()), parameter


def test_a_clean_scene_is_not_copied(calls: list[dict]) -> None:
    render(*SMALL, backend="gsplat")
    assert calls[0]["colors"] is SMALL[0].sh


@pytest.mark.parametrize("count", [0, 2])
def test_nothing_to_draw_shows_the_background(calls: list[dict], count: int) -> None:
    nobody = SMALL[0].select(torch.arange(count))
    view = replace(nobody, opacities=torch.full((count,), float("nan"))), SMALL[1]
    got, want = both(view, everything(view))
    assert calls == []
    assert got.dropped_nonfinite == count
    for name in MADE:
        assert torch.equal(getattr(got, name), getattr(want, name))
    assert torch.equal(got.rgb[0, 0], torch.tensor([0.3, 0.6, 0.1]))


def test_one_gaussian_on_one_pixel() -> None:
    view = SMALL[0].select(torch.tensor([0])), SMALL[1].resized((1, 1))
    oracles.assert_same_images(*both(view, everything(view)), CLOSE_DECIBELS)


def test_a_target_that_nobody_sees_has_no_say() -> None:
    gaussians, camera = SMALL
    behind = camera.world_from_camera.clone()
    behind[:3, :2] *= -1
    behind[:3, 2] *= -1
    settings = replace(everything(SMALL), flow_camera=camera.with_pose(behind))
    pose = camera.world_from_camera.clone().requires_grad_()
    made = render(
        gaussians, camera.with_pose(pose), outputs=("flow",), settings=settings, backend="gsplat"
    )
    made.flow.sum().backward()
    assert not made.flow.any()
    assert bool(torch.isfinite(pose.grad).all())


def test_autocast_does_not_reach_the_arithmetic() -> None:
    with torch.autocast("cpu", dtype=torch.bfloat16):
        inside = render(*SMALL, outputs=MADE, settings=everything(SMALL), backend="gsplat")
    outside = render(*SMALL, outputs=MADE, settings=everything(SMALL), backend="gsplat")
    for name in MADE:
        assert torch.equal(getattr(inside, name), getattr(outside, name))


def test_auto_takes_it_where_it_does_not_refuse(calls: list[dict]) -> None:
    render(*SMALL)
    assert len(calls) == 1
    render(*SMALL, outputs=("median_depth",))
    render(SMALL[0].to(torch.float64), SMALL[1])
    assert len(calls) == 1

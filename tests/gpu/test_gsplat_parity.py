"""gsplat against the reference on the same CUDA tensors; run with ``pytest -m gpu tests/gpu``."""

from collections.abc import Callable
from dataclasses import replace

import oracles_gsplat as oracles
import pytest
import torch
from oracles_gsplat import EXTREMES, MADE, View, aligned_view, both, everything, on, random_view

from diff4splat.render.api import render
from diff4splat.render.gsplat import backend as gsplat_backend
from diff4splat.render.settings import RenderSettings

pytestmark = [
    pytest.mark.gpu,
    # A compiler that gsplat starts may warn about anything.
    pytest.mark.filterwarnings("ignore"),
]
DEVICE, EDGE_PX, COUNT = "cuda", 192, 5000
MOST_STRAYS = 0.005
"""Part of the pixels in which a decision may fall differently."""


@pytest.fixture(scope="module", autouse=True)
def _gsplat_on_a_gpu() -> None:
    if not torch.cuda.is_available():
        pytest.skip("needs a CUDA device, found none")
    if gsplat_backend.loading_problem() is not None:
        pytest.skip(gsplat_backend.loading_problem())


def scene(name: str) -> View:
    views = {
        "random": lambda: random_view(EDGE_PX, COUNT),
        "aligned": lambda: aligned_view(EDGE_PX),
    }
    return on(DEVICE, views[name]())


def settings_for(view: View, **changes: object) -> RenderSettings:
    """With the largest alpha that the installed version has."""
    alpha_max, faintest = gsplat_backend.version_constants()
    if changes.get("antialias") and faintest > 0:
        pytest.skip("this gsplat is not used for antialias")
    return replace(everything(view), alpha_max=alpha_max, **changes)


def assert_finite_gradients(view: View, settings: RenderSettings) -> None:
    for outputs in (MADE, ("rgb",)):
        for name, gradient in oracles.gradients(view, "gsplat", settings, outputs).items():
            assert bool(torch.isfinite(gradient).all()), (name, outputs)


@pytest.mark.parametrize("name", ["random", "aligned"])
@pytest.mark.parametrize(
    "changes",
    [{}, {"antialias": True}, {"dilation_px2": 0.0}, {"dilation_px2": 2.0, "near_depth": 2.0}],
    ids=str,
)
def test_images(name: str, changes: dict, record_property: Callable[[str, object], None]) -> None:
    view = scene(name)
    got, want = both(view, settings_for(view, **changes))
    record_property("boundary_pixels", oracles.strays(got, want))
    record_property("pixels_left_early", int(oracles.left_early(want).sum()))
    oracles.assert_same_images(got, want)
    assert oracles.strays(got, want) <= MOST_STRAYS * want.alpha.numel()


@pytest.mark.parametrize("outputs", [("rgb",), ("depth",), ("alpha",), ("rgb", "depth"), ("flow",)])
def test_each_image_is_the_same_alone_and_in_company(outputs: tuple[str, ...]) -> None:
    view = scene("random")
    alone = render(*view, outputs=outputs, settings=settings_for(view), backend="gsplat")
    together = render(*view, outputs=MADE, settings=settings_for(view), backend="gsplat")
    for name in outputs:
        assert oracles.decibels(getattr(alone, name), getattr(together, name)) >= 100, name


@pytest.mark.parametrize("name", ["random", "aligned"])
@pytest.mark.parametrize("antialias", [False, True])
@pytest.mark.parametrize("outputs", [("rgb",), ("rgb", "depth"), MADE], ids=str)
def test_gradients(name: str, antialias: bool, outputs: tuple[str, ...]) -> None:
    view = scene(name)
    settings = settings_for(view, antialias=antialias)
    got, want = (
        oracles.gradients(view, backend, settings, outputs) for backend in ("gsplat", "reference")
    )
    oracles.assert_same_gradients(got, want)


@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name: str) -> None:
    view = on(DEVICE, EXTREMES[name])
    oracles.assert_same_images(*both(view, settings_for(view)))
    assert_finite_gradients(view, settings_for(view))


@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize("size_px", [(1, 1), (37, 53)])
def test_few_gaussians_and_pixels(count: int, size_px: tuple[int, int]) -> None:
    gaussians, camera = random_view()
    view = on(DEVICE, (gaussians.select(torch.arange(count)), camera.resized(size_px)))
    oracles.assert_same_images(*both(view, settings_for(view)))
    assert_finite_gradients(view, settings_for(view))


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e30])
def test_what_is_not_finite_is_counted_and_left_out(name: str, value: float) -> None:
    gaussians, camera = random_view()
    settings = settings_for((gaussians.to(torch.device(DEVICE)), camera))
    changed = getattr(gaussians, name).clone()
    changed[3] = changed[7] = value
    view = on(DEVICE, (replace(gaussians, **{name: changed}), camera))
    got, want = both(view, settings)
    assert got.dropped_nonfinite == 2
    oracles.assert_same_images(got, want)
    assert_finite_gradients(view, settings)


def test_a_pixel_left_early_misses_no_more_than_the_light_left_over() -> None:
    view = on(DEVICE, aligned_view(EDGE_PX, opacity=0.999))
    got, want = both(view, settings_for(view))
    early = oracles.left_early(want)
    assert bool(early.any())
    assert oracles.decibels(got.rgb[~early], want.rgb[~early]) >= oracles.LEAST_DECIBELS
    difference = (got.rgb - want.rgb).abs().amax(-1)
    assert bool((difference <= 1 - got.alpha + 1e-3).all())


def test_far_from_the_origin_the_image_is_the_same() -> None:
    gaussians, camera = scene("random")
    gaussians = replace(gaussians, means=(gaussians.means * 16).round() / 16)
    near, far = camera.world_from_camera.clone(), camera.world_from_camera.clone()
    near[:3, 3], far[:3, 3] = 0.0, 1e6
    away = replace(gaussians, means=gaussians.means + 1e6)
    settings = settings_for((gaussians, camera))
    there = render(away, camera.with_pose(far), settings=settings, backend="gsplat").rgb
    here = render(gaussians, camera.with_pose(near), settings=settings, backend="gsplat").rgb
    assert torch.equal(there, here)


def test_auto_takes_gsplat_for_tensors_on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    taken, view = [], scene("random")
    genuine = gsplat_backend.render
    monkeypatch.setattr(gsplat_backend, "render", lambda job: taken.append(job) or genuine(job))
    made = render(*view, settings=settings_for(view))
    assert len(taken) == 1
    assert made.rgb.device.type == DEVICE

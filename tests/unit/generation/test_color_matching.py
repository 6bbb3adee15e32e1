"""Colours with which the rendered input view is the image."""

from dataclasses import replace

import pytest
import torch
from image_layers import layer, layered, random_rgb, sliding_path

from diff4splat.generation.color_matching import (
    SMALLEST_SHARE,
    InputView,
    chebyshev_factors,
    match_input_view,
    matched_colors,
)
from diff4splat.generation.layered_image.gaussians import GaussianSet, image_gaussians
from diff4splat.generation.layered_image.types import NO_PIXEL
from diff4splat.metrics.image import psnr
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.harmonics import color_from_dc, dc_from_color
from diff4splat.scene.scene import Provenance, Scene

SIZE_PX = (12, 16)

FIRST_RATE = 2 / (1 + SMALLEST_SHARE)
"""Of the first step: one over the middle of the eigenvalues."""


def blurred(pixels: int | None = None) -> GaussianSet:
    """An image whose Gaussians overlap; the first ``pixels`` of them show one each, or all."""
    index = torch.arange(12 * 16).view(SIZE_PX)
    if pixels is not None:
        index = torch.where(index < pixels, index, NO_PIXEL)
    image = layer(torch.full(SIZE_PX, 4.0), opacity=0.999, pixel_index=index, footprint_px=0.5)
    return image_gaussians(layered(image), torch.zeros(1))


def view(gathered: GaussianSet) -> InputView:
    camera = layer(torch.ones(SIZE_PX)).camera
    return InputView(rgb=random_rgb(*SIZE_PX), camera=camera, pixel_index=gathered.pixel_index)


def scene_of(gathered: GaussianSet, dilation_px2: float = 0.0) -> Scene:
    camera = layer(torch.ones(SIZE_PX)).camera
    return Scene(
        gaussians=gathered.gaussians,
        motion=gathered.motion,
        path=sliding_path(camera, 1, (0.0, 0.0, 0.0)),
        provenance=Provenance(generator="test"),
        dilation_px2=dilation_px2,
    )


@pytest.mark.parametrize("dilation_px2", [0.0, 0.3])
def test_more_steps_are_nearer_the_image(dilation_px2: float) -> None:
    gathered, image = blurred(), view(blurred())
    scene, quality_db = scene_of(gathered, dilation_px2), []
    for steps in (0, 3, 12):
        matched = match_input_view(scene, image, steps, RunLog())
        settings = RenderSettings(dilation_px2=dilation_px2)
        rendered = render(matched.gaussians, image.camera, settings=settings).rgb.clamp(0, 1)
        quality_db.append(float(psnr(rendered, image.rgb)))
    assert quality_db[0] + 0.3 < quality_db[1] <= quality_db[2] + 0.1


def test_one_step_adds_the_residual_of_each_pixel() -> None:
    gathered, image = blurred(), view(blurred())
    residual = image.rgb - render(gathered.gaussians, image.camera).rgb
    before = color_from_dc(gathered.gaussians.sh[:, 0])
    after = color_from_dc(matched_colors(gathered.gaussians, image, 1)[:, 0])
    wanted = (before + FIRST_RATE * residual.flatten(0, 1)).clamp(0, 1)
    torch.testing.assert_close(after, wanted, atol=1e-5, rtol=0)


def test_a_later_step_keeps_a_part_of_the_one_before() -> None:
    gathered, image = blurred(), view(blurred())
    # In the middle of the range no colour is cut off.
    image = replace(image, rgb=0.45 + 0.1 * image.rgb)
    grey = replace(gathered.gaussians, sh=torch.zeros_like(gathered.gaussians.sh))
    once, twice = (color_from_dc(matched_colors(grey, image, steps)[:, 0]) for steps in (1, 2))
    after_one = replace(grey, sh=dc_from_color(once)[:, None])
    residual = (image.rgb - render(after_one, image.camera).rgb).flatten(0, 1)
    momentum, rate = list(chebyshev_factors(2))[1]
    assert momentum > 0.05
    wanted = once + momentum * (once - 0.5) + rate * residual
    torch.testing.assert_close(twice, wanted, atol=1e-5, rtol=0)


def test_cells_of_several_pixels_take_their_mean_residual() -> None:
    coarse = image_gaussians(
        layered(layer(torch.full((6, 8), 4.0), pixel_index=torch.arange(48).view(6, 8))),
        torch.zeros(1),
    )
    image = replace(view(blurred()), pixel_index=coarse.pixel_index, stride=2)
    residual = image.rgb - render(coarse.gaussians, image.camera).rgb
    cells = residual.unflatten(0, (6, 2)).unflatten(2, (8, 2)).mean((1, 3)).flatten(0, 1)
    before = color_from_dc(coarse.gaussians.sh[:, 0])
    after = color_from_dc(matched_colors(coarse.gaussians, image, 1)[:, 0])
    torch.testing.assert_close(after, (before + FIRST_RATE * cells).clamp(0, 1), atol=1e-5, rtol=0)


def test_gaussians_that_show_no_pixel_keep_their_colour() -> None:
    gathered = blurred(pixels=40)
    after = matched_colors(gathered.gaussians, view(gathered), 3)
    before = gathered.gaussians.sh
    assert torch.equal(after[40:], before[40:])
    assert bool((after[:40] != before[:40]).any())


def test_colours_stay_in_range_and_nothing_else_changes() -> None:
    scene = scene_of(blurred())
    matched = match_input_view(scene, view(blurred()), 12, RunLog())
    colors = color_from_dc(matched.gaussians.sh[:, 0])
    assert float(colors.min()) >= -1e-6 and float(colors.max()) <= 1 + 1e-6
    for name in ("means", "quats", "scales", "opacities"):
        assert getattr(matched.gaussians, name) is getattr(scene.gaussians, name)
    assert matched.motion is scene.motion


@pytest.mark.parametrize(("pixels", "steps"), [(0, 3), (None, 0)])
def test_without_pixels_or_steps_the_scene_is_the_same(pixels: int | None, steps: int) -> None:
    gathered, log = blurred(pixels), RunLog()
    scene = scene_of(gathered)
    assert match_input_view(scene, view(gathered), steps, log) is scene
    assert "match colours" not in log.phases.seconds


def test_chebyshev_factors_solve_any_blur_in_their_interval_faster_than_plain_steps() -> None:
    eigenvalues = torch.linspace(SMALLEST_SHARE, 1.0, 50, dtype=torch.float64)
    solution, step = torch.zeros_like(eigenvalues), torch.zeros_like(eigenvalues)
    for momentum, rate in chebyshev_factors(5):
        step = momentum * step + rate * (1 - eigenvalues * solution)
        solution = solution + step
    error = (1 - eigenvalues * solution).abs().max()
    plain = (1 - eigenvalues).pow(5).max()
    # The minimal maximum over all polynomials of this degree: 1 / T_5((1 + a) / (1 - a)).
    ratio = torch.tensor((1 + SMALLEST_SHARE) / (1 - SMALLEST_SHARE), dtype=torch.float64)
    best = 1 / torch.cosh(5 * torch.acosh(ratio))
    torch.testing.assert_close(error, best, rtol=1e-9, atol=0)
    assert error < plain / 30

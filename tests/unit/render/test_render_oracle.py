"""The renderer against two nested loops in float64."""

from dataclasses import replace

import pytest
import torch
from oracles_render import assert_close_to_oracle, brute_force, random_gaussians, small_camera

from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

IMAGES = ("rgb", "alpha", "depth", "median_depth")


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize(
    "settings",
    [
        RenderSettings(),
        RenderSettings(dilation_px2=0.0, background=(0.2, 0.5, 1.0)),
        RenderSettings(dilation_px2=1.0, antialias=True, alpha_max=0.6, alpha_cutoff=0.02),
    ],
)
def test_random_scenes_agree(settings: RenderSettings, dtype: torch.dtype) -> None:
    gaussians, camera = random_gaussians(30), small_camera()
    want = brute_force(gaussians, camera, settings)
    got = render(gaussians.to(dtype), camera, outputs=IMAGES, settings=settings)
    for name in IMAGES:
        assert getattr(got, name).dtype == dtype
        assert_close_to_oracle(getattr(got, name), getattr(want, name), want.doubtful, terms=30)


def test_gaussians_off_the_image_reach_into_it() -> None:
    gaussians, camera, settings = (
        random_gaussians(30, seed=3),
        small_camera((9, 9)),
        RenderSettings(),
    )
    aside = replace(
        gaussians,
        means=gaussians.means * torch.tensor([3.0, 3.0, 1.0]),
        scales=gaussians.scales * 4,
    )
    want = brute_force(aside, camera, settings)
    got = render(aside, camera, outputs=IMAGES, settings=settings)
    for name in IMAGES:
        assert_close_to_oracle(getattr(got, name), getattr(want, name), want.doubtful, terms=30)


@pytest.mark.parametrize(
    "settings",
    [
        RenderSettings(tile_px=1),
        RenderSettings(tile_px=5),
        RenderSettings(tile_px=64),
        RenderSettings(tile_px=3, memory_bytes=1 << 20),
    ],
)
def test_tiles_and_memory_do_not_change_the_image(settings: RenderSettings) -> None:
    gaussians, camera = random_gaussians(400, seed=1), small_camera()
    plain = render(gaussians, camera, outputs=IMAGES)
    other = render(gaussians, camera, outputs=IMAGES, settings=settings)
    for name in IMAGES:
        torch.testing.assert_close(getattr(other, name), getattr(plain, name), rtol=0, atol=1e-12)


def test_little_memory_does_not_change_the_gradient() -> None:
    camera, gradients = small_camera(), []
    for settings in (RenderSettings(), RenderSettings(memory_bytes=1 << 20, tile_px=1)):
        gaussians = random_gaussians(400, seed=1)
        gaussians.means.requires_grad_()
        render(gaussians, camera, settings=settings).rgb.square().sum().backward()
        gradients.append(gaussians.means.grad)
    torch.testing.assert_close(gradients[1], gradients[0], rtol=1e-9, atol=1e-9)


def test_equal_inputs_give_equal_bits() -> None:
    runs = []
    for _ in range(2):
        gaussians = random_gaussians(300, seed=2, dtype=torch.float32)
        gaussians.means.requires_grad_()
        rgb = render(gaussians, small_camera()).rgb
        rgb.sum().backward()
        runs.append((rgb.detach(), gaussians.means.grad))
    assert torch.equal(runs[0][0], runs[1][0])
    assert torch.equal(runs[0][1], runs[1][1])


def test_the_oracle_can_disagree() -> None:
    gaussians, camera, settings = random_gaussians(30), small_camera(), RenderSettings()
    want = brute_force(gaussians, camera, settings)
    got = render(gaussians, camera, settings=replace(settings, dilation_px2=0.31))
    with pytest.raises(AssertionError):
        assert_close_to_oracle(got.rgb, want.rgb, want.doubtful, terms=30)

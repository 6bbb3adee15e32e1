"""Images that can be written down."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import pixel_centers
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import dc_from_color

FOCAL_PX, DEPTH, SIGMA_PX = 20.0, 4.0, 1.5
CAMERA = pinhole(FOCAL_PX, (15, 15), torch.float64)


def on_axis(
    opacity: float, depth: float = DEPTH, rgb: tuple[float, ...] = (1.0, 1.0, 1.0)
) -> Gaussians:
    """One isotropic Gaussian in the middle of the image, SIGMA_PX wide."""
    scale = SIGMA_PX * depth / FOCAL_PX
    return Gaussians(
        means=torch.tensor([[0.0, 0.0, depth]], dtype=torch.float64),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], dtype=torch.float64),
        scales=torch.full((1, 3), scale, dtype=torch.float64),
        opacities=torch.tensor([opacity], dtype=torch.float64),
        sh=dc_from_color(torch.tensor([[rgb]], dtype=torch.float64)),
    )


def profile(opacity: float, variance_px2: float) -> Tensor:
    """opacity · exp(-r² / 2σ²) around the middle, 0 below the cutoff."""
    offsets = pixel_centers(CAMERA.size_px, CAMERA.focal_px) - 7.5
    alpha = opacity * torch.exp(-0.5 * offsets.square().sum(-1) / variance_px2)
    return torch.where(alpha >= 1 / 255, alpha, 0.0)


@pytest.mark.parametrize("dilation", [0.0, 0.3])
def test_one_gaussian_is_a_gaussian(dilation: float) -> None:
    made = render(
        on_axis(0.8),
        CAMERA,
        outputs=("rgb", "alpha"),
        settings=RenderSettings(dilation_px2=dilation),
    )
    torch.testing.assert_close(made.alpha, profile(0.8, SIGMA_PX**2 + dilation))
    torch.testing.assert_close(made.rgb, made.alpha[..., None].expand(-1, -1, 3))


def test_compensation_keeps_the_light_that_dilation_adds() -> None:
    settings = RenderSettings(dilation_px2=0.5, antialias=True)
    made = render(on_axis(0.8), CAMERA, outputs=("alpha",), settings=settings)
    factor = SIGMA_PX**2 / (SIGMA_PX**2 + 0.5)
    torch.testing.assert_close(made.alpha, profile(0.8 * factor, SIGMA_PX**2 + 0.5))


def test_a_rotated_ellipse_lies_along_its_axis() -> None:
    long = replace(
        on_axis(0.9),
        quats=torch.tensor(
            [[math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8)]], dtype=torch.float64
        ),
        scales=torch.tensor([[3.0, 0.5, 1.0]], dtype=torch.float64) * DEPTH / FOCAL_PX,
    )
    alpha = render(
        long, CAMERA, outputs=("alpha",), settings=RenderSettings(dilation_px2=0.0)
    ).alpha
    # x is right and y is down, so a turn by +45° about z points to the lower right.
    torch.testing.assert_close(float(alpha[9, 9]), 0.9 * math.exp(-0.5 * 8 / 9))
    torch.testing.assert_close(float(alpha[8, 6]), 0.9 * math.exp(-0.5 * 2 / 0.25))


def test_two_gaussians_cover_each_other() -> None:
    near = on_axis(0.6, depth=2.0, rgb=(1.0, 0.0, 0.0))
    far = on_axis(0.5, depth=6.0, rgb=(0.0, 1.0, 0.0))
    settings = RenderSettings(background=(0.0, 0.0, 1.0))
    made = render(
        concatenate([far, near]), CAMERA, outputs=("rgb", "alpha", "depth"), settings=settings
    )
    rgb = torch.tensor([0.6, 0.4 * 0.5, 0.4 * 0.5], dtype=torch.float64)
    torch.testing.assert_close(made.rgb[7, 7], rgb)
    torch.testing.assert_close(float(made.alpha[7, 7]), 0.8)
    torch.testing.assert_close(float(made.depth[7, 7]), (0.6 * 2 + 0.2 * 6) / 0.8)


@pytest.mark.parametrize(
    ("opacities", "median"), [((0.6, 0.9), 2.0), ((0.4, 0.5), 6.0), ((0.2, 0.3), 0.0)]
)
def test_median_depth_is_where_half_of_the_light_is_gone(
    opacities: tuple[float, float], median: float
) -> None:
    pair = concatenate([on_axis(opacities[0], depth=2.0), on_axis(opacities[1], depth=6.0)])
    assert float(render(pair, CAMERA, outputs=("median_depth",)).median_depth[7, 7]) == median


def test_equal_depths_keep_the_order_of_their_indices() -> None:
    pair = concatenate([on_axis(0.7, rgb=(1.0, 0.0, 0.0)), on_axis(0.7, rgb=(0.0, 1.0, 0.0))])
    first = render(pair, CAMERA).rgb[7, 7]
    swapped = render(pair.select(torch.tensor([1, 0])), CAMERA).rgb[7, 7]
    torch.testing.assert_close(first, torch.tensor([0.7, 0.21, 0.0], dtype=torch.float64))
    torch.testing.assert_close(swapped, torch.tensor([0.21, 0.7, 0.0], dtype=torch.float64))


def test_opacity_is_held_below_one() -> None:
    assert float(render(on_axis(1.0), CAMERA, outputs=("alpha",)).alpha[7, 7]) == pytest.approx(
        0.999
    )


def test_the_cutoff_itself_is_drawn() -> None:
    settings = RenderSettings(alpha_cutoff=0.25)
    assert (
        float(render(on_axis(0.25), CAMERA, outputs=("alpha",), settings=settings).alpha[7, 7])
        == 0.25
    )
    assert (
        float(render(on_axis(0.2499), CAMERA, outputs=("alpha",), settings=settings).alpha.max())
        == 0.0
    )


def test_depth_of_one_gaussian_is_its_z() -> None:
    depth = render(on_axis(0.5), CAMERA, outputs=("depth",)).depth
    torch.testing.assert_close(
        depth[profile(0.5, SIGMA_PX**2 + 0.3) > 0].unique(), torch.tensor([DEPTH]).double()
    )
    assert float(depth[0, 0]) == 0.0

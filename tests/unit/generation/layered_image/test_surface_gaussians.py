"""Gaussians along the surface: one footprint in the image, no gaps from the side."""

from dataclasses import replace

import pytest
import torch
from image_layers import FAR_RANGES, layer, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.build import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.surface_gaussians import (
    MOST_UNITS,
    SLOPE_UNIT,
    principal_axes,
    surface_steps,
)
from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import camera_rays
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

SIZE_PX, FOCAL_PX = (12, 16), 80.0


def pixels(depth: Tensor, in_image: bool = True) -> ImageLayer:
    shown = layer(depth, footprint_px=PIXEL_FOOTPRINT_PX, opacity=0.999, in_image=in_image)
    return replace(shown, camera=pinhole(FOCAL_PX, tuple(depth.shape)))


def receding(units: float, size: tuple[int, int] = SIZE_PX) -> Tensor:
    """z that grows by ``units`` of the steps that Gaussians follow, from column to column."""
    columns = torch.arange(float(size[1]), dtype=torch.float64)
    return (4.0 * torch.exp(units * SLOPE_UNIT / FOCAL_PX * columns)).expand(size)


def test_on_a_wall_they_are_as_wide_as_those_that_face_the_camera() -> None:
    image = pixels(torch.full(SIZE_PX, 4.0))
    gaussians = layer_gaussians(image)
    wide = PIXEL_FOOTPRINT_PX * 4.0 / FOCAL_PX
    torch.testing.assert_close(gaussians.scales, torch.full((len(gaussians), 3), wide))
    normals = quaternion.to_matrix(gaussians.quats)[..., 2]
    torch.testing.assert_close(normals[:, 2].abs(), torch.ones(len(gaussians)))


@pytest.mark.parametrize("units", [-1.0, 0.0, 1.0])
def test_steps_lead_to_the_next_pixel(units: float) -> None:
    image = pixels(receding(units))
    points = camera_rays(image.camera.to(torch.float64)) * image.depth[..., None]
    across, down = (steps * image.depth[..., None] for steps in surface_steps(image))
    ahead = points.diff(dim=1)
    torch.testing.assert_close(
        across[:, 1:-1], (ahead[:, 1:] + ahead[:, :-1]) / 2, rtol=0.02, atol=1e-3
    )
    torch.testing.assert_close(down[1:-1], points.diff(dim=0)[1:], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(("units", "want"), [(0.4, 0), (0.6, 1), (1.4, 1), (20.0, MOST_UNITS)])
def test_slopes_are_few(units: float, want: int) -> None:
    units = min(units, 0.9 * DEPTH_STEP * FOCAL_PX / SLOPE_UNIT)
    across, _ = surface_steps(pixels(receding(units)))
    slope = across[:, 1:-1, 2] * FOCAL_PX / SLOPE_UNIT
    torch.testing.assert_close(slope, torch.full_like(slope, min(want, round(units))))


def test_in_the_image_the_footprint_is_that_of_a_pixel() -> None:
    """Projected in float64, by hand: J Σ Jᵀ, with the thickness left out."""
    image = pixels(receding(1.0))
    gaussians = layer_gaussians(image).to(torch.float64)
    means = gaussians.means
    x, y, z = means.unbind(-1)
    zero = torch.zeros_like(z)
    rows = [FOCAL_PX / z, zero, -FOCAL_PX * x / z**2, zero, FOCAL_PX / z, -FOCAL_PX * y / z**2]
    jacobian = torch.stack(rows, -1).unflatten(-1, (2, 3))
    flat = torch.cat([gaussians.scales[:, :2], zero[:, None]], -1)
    root = jacobian @ quaternion.to_matrix(gaussians.quats) * flat[:, None]
    want = PIXEL_FOOTPRINT_PX**2 * torch.eye(2, dtype=torch.float64)
    torch.testing.assert_close(root @ root.mT, want.expand(len(z), 2, 2), rtol=1e-3, atol=1e-4)


def test_axes_are_those_of_the_covariance() -> None:
    generator = torch.Generator().manual_seed(1)
    first, second = torch.randn(2, 50, 3, generator=generator, dtype=torch.float64)
    axes, lengths = principal_axes(first, second)
    eye = torch.eye(3, dtype=torch.float64).expand(50, 3, 3)
    torch.testing.assert_close(axes.mT @ axes, eye)
    torch.testing.assert_close(torch.linalg.det(axes), torch.ones(50, dtype=torch.float64))
    want = first[:, :, None] * first[:, None] + second[:, :, None] * second[:, None]
    root = axes[..., :2] * lengths[:, None]
    torch.testing.assert_close(root @ root.mT, want)


def test_a_depth_edge_stretches_nothing() -> None:
    depth = torch.full(SIZE_PX, 2.0)
    depth[:, 8:] = 6.0
    wall = layer_gaussians(pixels(torch.ones(SIZE_PX))).scales[:1]
    got = layer_gaussians(pixels(depth)).scales / depth.flatten()[:, None]
    torch.testing.assert_close(got, wall.expand_as(got))


def test_steps_above_the_threshold_are_edges() -> None:
    depth = torch.exp(1.1 * DEPTH_STEP * torch.arange(16.0)).expand(SIZE_PX)
    relative = layer_gaussians(pixels(depth)).scales / depth.flatten()[:, None]
    torch.testing.assert_close(relative.std(0), torch.zeros(3), atol=1e-6, rtol=0)


def test_seen_from_the_side_a_slanted_surface_has_smaller_gaps() -> None:
    depth = receding(1.0, (24, 24)).float()
    focus = depth[12, 12]
    turn = torch.tensor(-0.3)
    pose = torch.eye(4)
    pose[0, 0], pose[0, 2] = turn.cos(), turn.sin()
    pose[2, 0], pose[2, 2] = -turn.sin(), turn.cos()
    pose[:3, 3] = torch.tensor([0.0, 0.0, focus]) - pose[:3, 2] * focus
    side = pinhole(FOCAL_PX, (24, 24)).with_pose(pose)
    settings = RenderSettings(dilation_px2=0.0)
    alphas = [
        render(layer_gaussians(pixels(depth, shown)), side, outputs=("alpha",), settings=settings)
        for shown in (True, False)
    ]
    along, facing = (float(each.alpha[8:16, 10:14].mean()) for each in alphas)
    assert along > facing + 0.1


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [SIZE_PX, (1, 6), (6, 1), (1, 1)])
def test_any_depth_and_size_is_finite(limits: tuple[float, float], size: tuple[int, int]) -> None:
    gaussians = layer_gaussians(pixels(random_depth(*size, limits)))
    for name in ("scales", "quats", "means"):
        assert bool(getattr(gaussians, name).isfinite().all()), name
    assert float(gaussians.scales.min()) > 0
